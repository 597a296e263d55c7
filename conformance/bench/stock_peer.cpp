// A stock YARP peer for the benchmark: the same work as ours, through the stock library.
//
//   stock_peer serve NAME            answers each request with itself
//   stock_peer count NAME            reads messages, answers an RPC on NAME/n with how many came
//   stock_peer call NAME N           N round trips of 16 bytes of payload; prints each in ns
//   stock_peer order NAME N          N orders [set] [pos] 0 V to the board NAME; prints the time of each in ns
//   stock_peer send NAME CARRIER N BYTES   sends N messages of BYTES payload; prints the total ns
//   stock_peer look NAME             as count, but of images
//   stock_peer show NAME CARRIER N   sends N images of 640 x 480; prints the total ns
//   stock_peer publish NAME          each line says how many messages of 16 bytes it writes; prints the total ns
//   stock_peer local blobs|images N  N messages between two ports of its own; prints the total ns
//
// Build: g++ -O2 -std=c++17 stock_peer.cpp -lYARP_os -lYARP_sig (with the stock installation's paths).
#include <yarp/os/Bottle.h>
#include <yarp/os/BufferedPort.h>
#include <yarp/os/ConnectionReader.h>
#include <yarp/os/ConnectionWriter.h>
#include <yarp/os/Network.h>
#include <yarp/os/Port.h>
#include <yarp/os/PortReader.h>
#include <yarp/os/RpcClient.h>
#include <yarp/os/RpcServer.h>
#include <yarp/os/Value.h>
#include <yarp/os/Vocab.h>
#include <yarp/sig/Image.h>

#include <atomic>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>
#include <thread>
#include <vector>

using Steady = std::chrono::steady_clock;
using namespace yarp::os;

static long long ns(Steady::time_point from, Steady::time_point to)
{
    return std::chrono::duration_cast<std::chrono::nanoseconds>(to - from).count();
}

// A message of raw bytes, laid out as a bottle of one blob.
class Blob : public Portable
{
public:
    std::vector<char> bytes;
    bool read(ConnectionReader& reader) override
    {
        if (reader.isTextMode()) {
            Bottle bottle;
            return bottle.read(reader) && bottle.get(0).isBlob();
        }
        int code = reader.expectInt32();
        int count = reader.expectInt32();
        int length = reader.expectInt32();
        if (code != 256 + 12 || count != 1 || length < 0) {
            return false;
        }
        bytes.resize(length);
        return reader.expectBlock(bytes.data(), bytes.size());
    }
    bool write(ConnectionWriter& writer) const override
    {
        if (writer.isTextMode()) {
            Bottle bottle;
            bottle.add(Value::makeBlob(const_cast<char*>(bytes.data()), bytes.size()));
            return bottle.write(writer);
        }
        writer.appendInt32(256 + 12);
        writer.appendInt32(1);
        writer.appendInt32(bytes.size());
        writer.appendExternalBlock(bytes.data(), bytes.size());
        return true;
    }
};

class Echo : public PortReader
{
    bool read(ConnectionReader& reader) override
    {
        Bottle request;
        if (!request.read(reader)) {
            return false;
        }
        if (ConnectionWriter* writer = reader.getWriter()) {
            request.write(*writer);
        }
        return true;
    }
};

template <class Message>
class Counter : public PortReader
{
public:
    std::atomic<long long> count{0};
    Message message;
    bool read(ConnectionReader& reader) override
    {
        if (!message.read(reader)) {
            return false;
        }
        count++;
        return true;
    }
};

// Each line asks for the count reached; answered as soon as it is.
template <class Message>
static bool count_messages(const std::string& name)
{
    Port port;
    Counter<Message> counter;
    port.setReader(counter);
    if (!port.open(name)) {
        return false;
    }
    puts("ready");
    fflush(stdout);
    long long goal = 0;
    while (scanf("%lld", &goal) == 1) {
        while (counter.count < goal) {
            std::this_thread::sleep_for(std::chrono::microseconds(50));
        }
        printf("%lld\n", (long long)counter.count);
        fflush(stdout);
    }
    return true;
}

// Slopes with a little noise, as a camera sees; the same as in `src/bin/bench/peer_programs.rs`.
static void paint(yarp::sig::ImageOf<yarp::sig::PixelRgb>& image)
{
    image.resize(640, 480);
    uint32_t noise = 1;
    for (uint32_t y = 0; y < 480; y++) {
        for (uint32_t x = 0; x < 640; x++) {
            noise = noise * 1664525 + 1013904223;
            uint32_t grain = noise >> 29;
            auto& pixel = image.pixel(x, y);
            pixel.r = x / 3 + grain;
            pixel.g = y / 2 + grain;
            pixel.b = (x * x + y * y) / 2560 + grain;
        }
    }
}

// Who asked for a connection may know of it before the port that writes.
static void write_all(Port& port, const PortWriter& message, int n)
{
    while (port.getOutputCount() == 0) {
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    auto begin = Steady::now();
    for (int i = 0; i < n; i++) {
        port.write(message);
    }
    printf("%lld\n", ns(begin, Steady::now()));
    fflush(stdout);
}

static void wait_for_end()
{
    while (getchar() != EOF) {
    }
}

// Messages between two ports of this process.
template <class Message>
static bool write_within(const Message& message, int n)
{
    BufferedPort<Message> reader;
    Port writer;
    reader.setStrict();
    reader.open("...");
    writer.open("...");
    if (!Network::connect(writer.getName(), reader.getName(), "local", true)) {
        return false;
    }
    auto begin = Steady::now();
    std::thread reading([&] {
        for (int i = 0; i < n; i++) {
            reader.read();
        }
    });
    for (int i = 0; i < n; i++) {
        writer.write(message);
    }
    reading.join();
    printf("%lld\n", ns(begin, Steady::now()));
    fflush(stdout);
    wait_for_end();
    writer.close();
    reader.close();
    return true;
}

int main(int argc, char** argv)
{
    if (argc < 3) {
        return 2;
    }
    Network network;
    std::string what = argv[1];
    std::string name = argv[2];
    if (what == "serve") {
        Port port;
        Echo echo;
        port.setReader(echo);
        if (!port.open(name)) {
            return 1;
        }
        puts("ready");
        fflush(stdout);
        wait_for_end();
    } else if (what == "count") {
        return count_messages<Blob>(name) ? 0 : 1;
    } else if (what == "look") {
        return count_messages<yarp::sig::ImageOf<yarp::sig::PixelRgb>>(name) ? 0 : 1;
    } else if (what == "call" && argc == 4) {
        RpcClient port;
        port.open("...");
        if (!Network::connect(port.getName(), name, "tcp", true)) {
            return 1;
        }
        int n = atoi(argv[3]);
        Bottle request;
        request.addInt32(1);
        request.addInt32(2);
        for (int i = 0; i < n; i++) {
            Bottle reply;
            auto begin = Steady::now();
            port.write(request, reply);
            auto end = Steady::now();
            if (reply.size() != 2) {
                return 1;
            }
            printf("%lld\n", ns(begin, end));
        }
        port.close();
    } else if (what == "order" && argc == 4) {
        RpcClient port;
        port.open("...");
        // The board may still be on its way.
        for (int tries = 0; !Network::connect(port.getName(), name + "/rpc:i", "tcp", true); tries++) {
            if (tries == 100) {
                return 1;
            }
            std::this_thread::sleep_for(std::chrono::milliseconds(100));
        }
        int n = atoi(argv[3]);
        for (int i = 0; i < n; i++) {
            Bottle request;
            Bottle reply;
            request.addVocab32("set");
            request.addVocab32("pos");
            request.addInt32(0);
            request.addFloat64(i % 2 == 0 ? 5.0 : -5.0);
            auto begin = Steady::now();
            port.write(request, reply);
            auto end = Steady::now();
            if (reply.get(0).asVocab32() != createVocab32('o', 'k')) {
                return 1;
            }
            printf("%lld\n", ns(begin, end));
        }
        port.close();
    } else if (what == "send" && argc == 6) {
        Port port;
        port.open("...");
        if (!Network::connect(port.getName(), name, argv[3], true)) {
            return 1;
        }
        Blob blob;
        blob.bytes.resize(atoi(argv[5]));
        write_all(port, blob, atoi(argv[4]));
        wait_for_end();
        port.close();
    } else if (what == "show" && argc == 5) {
        Port port;
        port.open("...");
        if (!Network::connect(port.getName(), name, argv[3], true)) {
            return 1;
        }
        yarp::sig::ImageOf<yarp::sig::PixelRgb> image;
        paint(image);
        write_all(port, image, atoi(argv[4]));
        wait_for_end();
        port.close();
    } else if (what == "publish") {
        Port port;
        if (!port.open(name)) {
            return 1;
        }
        puts("ready");
        fflush(stdout);
        Blob blob;
        blob.bytes.resize(16, 7);
        int n = 0;
        while (scanf("%d", &n) == 1) {
            write_all(port, blob, n);
        }
        port.close();
    } else if (what == "local" && argc == 4) {
        int n = atoi(argv[3]);
        if (name == "images") {
            yarp::sig::ImageOf<yarp::sig::PixelRgb> image;
            paint(image);
            return write_within(image, n) ? 0 : 1;
        }
        Blob blob;
        blob.bytes.resize(16, 7);
        return write_within(blob, n) ? 0 : 1;
    }
    return 0;
}
