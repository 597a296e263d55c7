// Reads descriptions of robots through the stock library: the name of a file a line on standard input, and for each a line
// `ROBOT` with a JSON object, in which `ok` is false for what stock does not read.
//
// Build: g++ -std=c++17 -include cstdint robot_reader.cpp -lYARP_robotinterface -lYARP_dev -lYARP_os -lYARP_init
// (with the paths of stock 3.5.0 or 4.0).
#include <yarp/os/Bottle.h>
#include <yarp/os/Network.h>
#include <yarp/os/Property.h>
#include <yarp/os/Value.h>
#include <yarp/robotinterface/XMLReader.h>

#include <cmath>
#include <cstdio>
#include <iostream>
#include <sstream>
#include <string>

using namespace yarp::robotinterface;

namespace {

std::string quoted(const std::string& text)
{
    std::string out = "\"";
    for (unsigned char byte : text) {
        if (byte == '"' || byte == '\\') {
            out += '\\';
            out += static_cast<char>(byte);
        } else if (byte < 0x20) {
            char escaped[8];
            std::snprintf(escaped, sizeof escaped, "\\u%04x", byte);
            out += escaped;
        } else {
            out += static_cast<char>(byte);
        }
    }
    return out + "\"";
}

std::string json(const yarp::os::Value& value);

std::string json(const yarp::os::Bottle& values)
{
    std::string out = "[";
    for (size_t index = 0; index < values.size(); index++) {
        out += (index ? "," : "") + json(values.get(index));
    }
    return out + "]";
}

std::string json(const yarp::os::Value& value)
{
    if (value.isList()) {
        return json(*value.asList());
    }
    if (value.isInt8() || value.isInt16() || value.isInt32() || value.isInt64()) {
        return std::to_string(value.asInt64());
    }
    if ((value.isFloat32() || value.isFloat64()) && std::isfinite(value.asFloat64())) {
        char number[64];
        std::snprintf(number, sizeof number, "%.17e", value.asFloat64());
        return number;
    }
    return quoted(value.toString());
}

// As `Device::open` does.
std::string json(const ParamList& given, bool ofDevice)
{
    yarp::os::Property all;
    for (const auto& param : ofDevice ? mergeDuplicateGroups(given) : given) {
        all.fromString("(" + param.name() + " " + param.value() + ")", false);
    }
    return json(yarp::os::Bottle(all.toString()));
}

std::string json(const Device& device)
{
    std::string out = "{\"name\":" + quoted(device.name()) + ",\"type\":" + quoted(device.type())
                      + ",\"params\":" + json(device.params(), true) + ",\"actions\":[";
    bool first = true;
    for (const auto& action : device.actions()) {
        out += (first ? "[" : ",[") + quoted(ActionPhaseToString(action.phase())) + "," + std::to_string(action.level()) + ","
               + quoted(ActionTypeToString(action.type())) + "," + json(action.params(), false) + "]";
        first = false;
    }
    return out + "]}";
}

} // namespace

int main()
{
    yarp::os::Network yarp;
    std::string file;
    while (std::getline(std::cin, file)) {
        XMLReader reader;
        reader.setVerbose(false);
        auto result = reader.getRobotFromFile(file);
        std::string out = "{\"ok\":false}";
        if (result.parsingIsSuccessful) {
            const auto& robot = result.robot;
            out = "{\"ok\":true,\"name\":" + quoted(robot.name()) + ",\"build\":" + std::to_string(robot.build())
                  + ",\"portprefix\":" + quoted(robot.portprefix()) + ",\"devices\":[";
            bool first = true;
            for (const auto& device : robot.devices()) {
                out += (first ? "" : ",") + json(device);
                first = false;
            }
            out += "]}";
        }
        std::cout << "\nROBOT " << out << std::endl;
    }
    return 0;
}
