// Writes and reads the typed messages through the stock library, one a line.
//
// The lines are those of yarp-wire's example `typed`, which explains them: `TYPE write CONTENT` is
// answered by the message in hexadecimal, `TYPE read HEX` by the content.
//
// Build: g++ -std=c++17 -include cstdint typed_peer.cpp -lYARP_os -lYARP_sig -lYARP_init
// (with the paths of stock 3.5.0 or 4.0).
#include <yarp/conf/version.h>
#include <yarp/os/Bottle.h>
#include <yarp/os/ConnectionReader.h>
#include <yarp/os/ConnectionWriter.h>
#include <yarp/os/DummyConnector.h>
#include <yarp/os/PortablePair.h>
#include <yarp/os/Property.h>
#include <yarp/os/Stamp.h>
#include <yarp/sig/Image.h>
#include <yarp/sig/Matrix.h>
#include <yarp/sig/Sound.h>
#include <yarp/sig/Vector.h>

#include <cstring>
#include <iostream>
#include <stdexcept>
#include <string>
#include <vector>

using namespace yarp::os;
using namespace yarp::sig;

static std::string toHex(const Portable& object)
{
    DummyConnector connector;
    connector.setTextMode(false);
    if (!object.write(connector.getWriter())) {
        throw std::runtime_error("not written");
    }
    ConnectionReader& reader = connector.getReader();
    std::string hex;
    std::vector<char> bytes(reader.getSize());
    reader.expectBlock(bytes.data(), bytes.size());
    for (unsigned char byte : bytes) {
        hex += "0123456789abcdef"[byte >> 4];
        hex += "0123456789abcdef"[byte & 15];
    }
    return hex;
}

template <class T>
static void fromHex(const std::string& hex, T& object)
{
    DummyConnector connector;
    connector.setTextMode(false);
    std::vector<char> bytes;
    for (size_t at = 0; at + 1 < hex.size(); at += 2) {
        bytes.push_back(static_cast<char>(std::stoi(hex.substr(at, 2), nullptr, 16)));
    }
    connector.getWriter().appendBlock(bytes.data(), bytes.size());
    ConnectionReader& reader = connector.getReader();
    if (!object.read(reader)) {
        throw std::runtime_error("refused");
    }
    if (reader.getSize() != 0) {
        throw std::runtime_error("bytes left over");
    }
}

static void mark(Image& image, bool marked)
{
#if YARP_VERSION_MAJOR < 4
    image.setTopIsLowIndex(!marked);
#else
    if (marked) {
        throw std::runtime_error("4.0 has no mark");
    }
#endif
}

static bool isMarked(const Image& image)
{
#if YARP_VERSION_MAJOR < 4
    return !image.topIsLowIndex();
#else
    return false;
#endif
}

// Everything but the code, which some images have by their type.
static void fill(Image& image, const Bottle& content)
{
    mark(image, content.get(4).asInt32() != 0);
    image.resize(content.get(1).asInt32(), content.get(2).asInt32());
    const char* packed = content.get(5).asBlob();
    const size_t height = image.height();
    const size_t row = height == 0 ? 0 : content.get(5).asBlobLength() / height;
    memset(image.getRawImage(), 0, image.getRawImageSize());
    for (size_t y = 0; y < height; y++) {
        memcpy(image.getRawImage() + y * image.getRowSize(), packed + y * row, row);
    }
}

static void tell(const Image& image, Bottle& content)
{
    content.addInt32(image.getPixelCode());
    content.addInt32(image.width());
    content.addInt32(image.height());
    content.addInt32(image.getQuantum());
    content.addInt32(isMarked(image) ? 1 : 0);
    // Stock states one byte for 4:2:2 and keeps two.
    const bool two = image.getPixelCode() == VOCAB_PIXEL_YUV_422;
    const size_t row = image.width() * image.getPixelSize() * (two ? 2 : 1);
    std::string packed;
    for (size_t y = 0; y < image.height(); y++) {
        packed.append(reinterpret_cast<char*>(image.getRawImage()) + y * image.getRowSize(), row);
    }
    content.add(Value(const_cast<char*>(packed.data()), packed.size()));
}

static void add(Bottle& content, double value)
{
    content.addFloat64(value);
}

static void add(Bottle& content, int value)
{
    content.addInt32(value);
}

template <class T>
static std::string writeVector(const Bottle& content)
{
    VectorOf<T> vector;
    for (size_t i = 0; i < content.size(); i++) {
        vector.push_back(static_cast<T>(content.get(i).asFloat64()));
    }
    return toHex(vector);
}

template <class T>
static Bottle readVector(const std::string& hex)
{
    VectorOf<T> vector;
    fromHex(hex, vector);
    Bottle content;
    for (T value : vector) {
        add(content, value);
    }
    return content;
}

template <class T>
static std::string writeImage(const Bottle& content)
{
    ImageOf<T> image;
    image.setQuantum(content.get(3).asInt32());
    fill(image, content);
    return toHex(image);
}

template <class T>
static Bottle readImage(const std::string& hex)
{
    ImageOf<T> image;
    fromHex(hex, image);
    Bottle content;
    tell(image, content);
    return content;
}

// Types that have a type of element.
struct Entry
{
    const char* name;
    std::string (*write)(const Bottle&);
    Bottle (*read)(const std::string&);
};

static const Entry templates[] = {
    {"vector_f64", writeVector<double>, readVector<double>},
    {"vector_i32", writeVector<int>, readVector<int>},
#if YARP_VERSION_MAJOR >= 4
    {"vector_f32", writeVector<float>, readVector<float>},
    {"vector_i16", writeVector<short>, readVector<short>},
    {"vector_u16", writeVector<unsigned short>, readVector<unsigned short>},
    {"vector_i8", writeVector<char>, readVector<char>},
    {"vector_u8", writeVector<unsigned char>, readVector<unsigned char>},
#endif
    {"image_mono", writeImage<PixelMono>, readImage<PixelMono>},
    {"image_mo16", writeImage<PixelMono16>, readImage<PixelMono16>},
    {"image_rgb", writeImage<PixelRgb>, readImage<PixelRgb>},
    {"image_rgba", writeImage<PixelRgba>, readImage<PixelRgba>},
    {"image_bgra", writeImage<PixelBgra>, readImage<PixelBgra>},
    {"image_int", writeImage<PixelInt>, readImage<PixelInt>},
    {"image_hsv", writeImage<PixelHsv>, readImage<PixelHsv>},
    {"image_bgr", writeImage<PixelBgr>, readImage<PixelBgr>},
    {"image_sign", writeImage<PixelMonoSigned>, readImage<PixelMonoSigned>},
    {"image_rgbi", writeImage<PixelRgbInt>, readImage<PixelRgbInt>},
    {"image_dec", writeImage<PixelFloat>, readImage<PixelFloat>},
    {"image_rgb.", writeImage<PixelRgbFloat>, readImage<PixelRgbFloat>},
};

static const Entry* find(const std::string& kind)
{
    for (const Entry& entry : templates) {
        if (kind == entry.name) {
            return &entry;
        }
    }
    return nullptr;
}

static std::string write(const std::string& kind, const Bottle& content)
{
    if (const Entry* entry = find(kind)) {
        return entry->write(content);
    }
    const auto number = [&](size_t at) { return content.get(at).asFloat64(); };
    const auto integer = [&](size_t at) { return content.get(at).asInt32(); };
    const size_t size = content.size();
    if (kind == "matrix") {
        Matrix matrix(integer(0), integer(1));
        for (size_t i = 2; i < size; i++) {
            matrix.data()[i - 2] = number(i);
        }
        return toHex(matrix);
    }
    if (kind == "image" || kind == "convert") {
        FlexImage image;
        image.setPixelCode(integer(0));
        image.setQuantum(integer(3));
        fill(image, content);
        if (kind == "image") {
            return toHex(image);
        }
        FlexImage converted;
        converted.setPixelCode(integer(6));
        converted.setQuantum(integer(3));
        mark(converted, integer(4) != 0);
        converted.copy(image);
        return toHex(converted);
    }
    if (kind == "sound") {
        Sound sound;
        const size_t channels = integer(1);
        size_t last = size;
        while (content.get(last - 1).isList()) {
            last--;
        }
        const size_t length = (last - 2) / channels;
        sound.resize(length, channels);
        sound.setFrequency(integer(0));
        for (size_t i = 2; i < last; i++) {
            sound.set(integer(i), (i - 2) % length, (i - 2) / length);
        }
#if YARP_VERSION_MAJOR >= 4
        for (size_t i = last; i < size; i++) {
            const Bottle& marker = *content.get(i).asList();
            sound.add_marker(marker.get(0).asString(), marker.get(1).asInt64(), marker.get(2).asInt32());
        }
#endif
        return toHex(sound);
    }
    if (kind == "stamp") {
        return toHex(Stamp(integer(0), number(1)));
    }
    if (kind == "property") {
        Property property;
        property.fromString(content.toString());
        return toHex(property);
    }
    if (kind == "pair") {
        PortablePair<Stamp, VectorOf<double>> pair;
        pair.head = Stamp(integer(0), number(1));
        for (size_t i = 2; i < size; i++) {
            pair.body.push_back(number(i));
        }
        return toHex(pair);
    }
    if (kind == "grasp" || kind == "bottle") {
        return toHex(content);
    }
    throw std::runtime_error("no such type");
}

static std::string read(const std::string& kind, const std::string& hex)
{
    Bottle content;
    if (const Entry* entry = find(kind)) {
        content = entry->read(hex);
    } else if (kind == "matrix") {
        Matrix matrix;
        fromHex(hex, matrix);
        content.addInt32(matrix.rows());
        content.addInt32(matrix.cols());
        for (size_t i = 0; i < matrix.rows() * matrix.cols(); i++) {
            content.addFloat64(matrix.data()[i]);
        }
    } else if (kind == "image") {
        FlexImage image;
        fromHex(hex, image);
        tell(image, content);
    } else if (kind == "sound") {
        Sound sound;
        fromHex(hex, sound);
        content.addInt32(sound.getFrequency());
        content.addInt32(sound.getChannels());
        for (size_t channel = 0; channel < sound.getChannels(); channel++) {
            for (size_t i = 0; i < sound.getSamples(); i++) {
                content.addInt32(sound.get(i, channel));
            }
        }
#if YARP_VERSION_MAJOR >= 4
        for (const SoundMarker& place : sound.getMarkers()) {
            Bottle& marker = content.addList();
            marker.addString(place.label);
            marker.addInt64(place.sample_id);
            marker.addInt32(place.channel);
        }
#endif
    } else if (kind == "stamp") {
        Stamp stamp;
        fromHex(hex, stamp);
        content.addInt32(stamp.getCount());
        content.addFloat64(stamp.getTime());
    } else if (kind == "property") {
        Property property;
        fromHex(hex, property);
        content.fromString(property.toString());
    } else if (kind == "pair") {
        PortablePair<Stamp, VectorOf<double>> pair;
        fromHex(hex, pair);
        content.addInt32(pair.head.getCount());
        content.addFloat64(pair.head.getTime());
        for (double value : pair.body) {
            content.addFloat64(value);
        }
    } else if (kind == "grasp" || kind == "bottle") {
        fromHex(hex, content);
    } else {
        throw std::runtime_error("no such type");
    }
    return content.toString();
}

int main()
{
    std::string line;
    while (std::getline(std::cin, line)) {
        const size_t first = line.find(' ');
        const size_t second = line.find(' ', first + 1);
        const std::string kind = line.substr(0, first);
        const std::string verb = line.substr(first + 1, second - first - 1);
        const std::string rest = second == std::string::npos ? "" : line.substr(second + 1);
        try {
            std::cout << (verb == "write" ? write(kind, Bottle(rest)) : read(kind, rest)) << "\n";
        } catch (const std::exception& error) {
            std::cout << "error: " << error.what() << "\n";
        }
        std::cout.flush();
    }
}
