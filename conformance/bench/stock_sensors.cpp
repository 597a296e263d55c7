// Stock's `multipleanalogsensorsserver` with 50 gyroscopes at 1 kHz, the peer of `bench_sensors`.
//
//     stock_sensors NAME        serves until it is killed

#include <cstdio>
#include <string>

#include <yarp/dev/DeviceDriver.h>
#include <yarp/dev/IMultipleWrapper.h>
#include <yarp/dev/MultipleAnalogSensorsInterfaces.h>
#include <yarp/dev/PolyDriver.h>
#include <yarp/dev/PolyDriverList.h>
#include <yarp/os/Network.h>
#include <yarp/os/Property.h>
#include <yarp/os/SystemClock.h>
#include <yarp/os/Time.h>

namespace {
constexpr size_t sensors = 50;

class Gyroscopes : public yarp::dev::DeviceDriver, public yarp::dev::IThreeAxisGyroscopes {
public:
    size_t getNrOfThreeAxisGyroscopes() const override { return sensors; }
    yarp::dev::MAS_status getThreeAxisGyroscopeStatus(size_t) const override { return yarp::dev::MAS_OK; }
    bool getThreeAxisGyroscopeName(size_t index, std::string& name) const override {
        name = "gyroscope" + std::to_string(index);
        return index < sensors;
    }
    bool getThreeAxisGyroscopeFrameName(size_t index, std::string& name) const override {
        name = "frame" + std::to_string(index);
        return index < sensors;
    }
    bool getThreeAxisGyroscopeMeasure(size_t index, yarp::sig::Vector& out, double& time) const override {
        out.resize(3);
        out[0] = static_cast<double>(index);
        out[1] = 1.0;
        out[2] = 2.0;
        time = yarp::os::Time::now();
        return index < sensors;
    }
};
} // namespace

int main(int argc, char* argv[]) {
    if (argc != 2) {
        std::fprintf(stderr, "usage: stock_sensors NAME\n");
        return 2;
    }
    yarp::os::Network network;
    Gyroscopes gyroscopes;
    yarp::dev::PolyDriver device;
    // The driver does not own it.
    device.give(&gyroscopes, false);
    yarp::os::Property options;
    options.put("device", "multipleanalogsensorsserver");
    options.put("name", argv[1]);
    options.put("period", 1);
    yarp::dev::PolyDriver server;
    if (!server.open(options)) {
        return 1;
    }
    yarp::dev::IMultipleWrapper* wrapper = nullptr;
    yarp::dev::PolyDriverList list;
    list.push(&device, "gyroscopes");
    if (!server.view(wrapper) || !wrapper->attachAll(list)) {
        return 1;
    }
    while (true) {
        yarp::os::SystemClock::delaySystem(60.0);
    }
}
