// Calls a served arm in 3.x's words, as people type them, from a program of stock YARP 4.0: nothing in what it sends
// betrays its generation, and the floats in the replies must be those that were meant all the same. Prints `ok` or
// `FAIL` per call. Ends with 1 if any check failed.
//
//     caller_4 RPC_PORT
#include <yarp/os/Bottle.h>
#include <yarp/os/Network.h>
#include <yarp/os/RpcClient.h>
#include <yarp/os/Time.h>
#include <cmath>
#include <cstdio>
#include <string>
using namespace yarp::os;

static int failures = 0;

static void check(const std::string& what, bool good)
{
    if (!good) {
        failures++;
    }
    std::printf("%s %s\n", good ? "ok  " : "FAIL", what.c_str());
    std::fflush(stdout);
}

int main(int argc, char** argv)
{
    Network network;
    if (argc < 2) {
        return 2;
    }
    for (std::string carrier : {"tcp", "fast_tcp"}) {
        RpcClient client;
        client.open("/caller4/" + carrier);
        const double before = Time::now();
        check(carrier + " connects", Network::connect(client.getName(), argv[1], carrier));
        // Stock answers who asks it while it connects; nobody waits until we have given up.
        check(carrier + " is asked at once", Time::now() - before < 0.9);
        Bottle request("[get] [encs]");
        Bottle reply;
        check(carrier + " is answered", client.write(request, reply));
        const Bottle* joints = reply.get(2).asList();
        bool good = joints != nullptr && joints->size() == 7;
        for (size_t i = 0; good && i < joints->size(); i++) {
            const double degrees = joints->get(i).asFloat64();
            good = joints->get(i).isFloat64() && std::fabs(degrees) < 360.0 && (degrees == 0.0 || std::fabs(degrees) > 1e-30);
        }
        check(carrier + " reads the positions: " + reply.toString(), good);
        const double target = carrier == "tcp" ? 12 : 23;
        client.write(Bottle("[set] [pos] 0 " + std::to_string(int(target))), reply);
        bool there = false;
        for (int i = 0; i < 600 && !there; i++) {
            client.write(Bottle("[get] [enc] 0"), reply);
            there = std::fabs(reply.get(2).asFloat64() - target) < 0.01;
            Time::delay(0.05);
        }
        check(carrier + " sees it arrive: " + reply.toString(), there);
        client.close();
    }
    return failures == 0 ? 0 : 1;
}
