// Stock's devices `inertial` and `virtualAnalogServer` with sensors of this program, the peer of `inertial_and_torques.py`.
//
//     sensors_peer inertial NAME   serves twelve numbers, 0 but for gravity
//     sensors_peer torques NAME    prints the torques that two boards get, a line for each: BOARD VALUE ...
//
// Both run until they are killed.

#include <cstdio>
#include <string>

#include <yarp/dev/DeviceDriver.h>
#include <yarp/dev/IGenericSensor.h>
#include <yarp/dev/IMultipleWrapper.h>
#include <yarp/dev/IVirtualAnalogSensor.h>
#include <yarp/dev/PolyDriver.h>
#include <yarp/dev/PolyDriverList.h>
#include <yarp/os/Network.h>
#include <yarp/os/Property.h>
#include <yarp/os/SystemClock.h>
#include <yarp/sig/Vector.h>

namespace {
class Imu : public yarp::dev::DeviceDriver, public yarp::dev::IGenericSensor {
public:
    bool read(yarp::sig::Vector& out) override {
        out.resize(12);
        out.zero();
        out[5] = 9.80665;
        return true;
    }
    bool getChannels(int* count) override {
        *count = 12;
        return true;
    }
    bool calibrate(int, double) override { return true; }
};

class Board : public yarp::dev::DeviceDriver, public yarp::dev::IVirtualAnalogSensor {
public:
    explicit Board(const char* called) : name(called) {}
    yarp::dev::VAS_status getVirtualAnalogSensorStatus(int) override { return yarp::dev::VAS_status::VAS_OK; }
    int getVirtualAnalogSensorChannels() override { return 4; }
    bool updateVirtualAnalogSensorMeasure(yarp::sig::Vector& measure) override {
        std::string line = name;
        for (size_t i = 0; i < measure.size(); ++i) {
            line += " " + std::to_string(measure[i]);
        }
        std::printf("%s\n", line.c_str());
        std::fflush(stdout);
        return true;
    }
    bool updateVirtualAnalogSensorMeasure(int, double&) override { return false; }

private:
    std::string name;
};

int serve(const yarp::os::Property& options, yarp::dev::PolyDriverList& list) {
    yarp::dev::PolyDriver server;
    yarp::dev::IMultipleWrapper* wrapper = nullptr;
    yarp::os::Property config(options);
    if (!server.open(config) || !server.view(wrapper) || !wrapper->attachAll(list)) {
        return 1;
    }
    while (true) {
        yarp::os::SystemClock::delaySystem(60.0);
    }
}
} // namespace

int main(int argc, char* argv[]) {
    if (argc != 3) {
        std::fprintf(stderr, "usage: sensors_peer inertial|torques NAME\n");
        return 2;
    }
    yarp::os::Network network;
    yarp::os::Property options;
    options.put("name", argv[2]);
    yarp::dev::PolyDriverList list;
    if (std::string(argv[1]) == "inertial") {
        Imu imu;
        yarp::dev::PolyDriver device;
        // The driver does not own it.
        device.give(&imu, false);
        list.push(&device, "imu");
        options.put("device", "inertial");
        options.put("period", 0.005);
        return serve(options, list);
    }
    Board upper("upper"), lower("lower");
    yarp::dev::PolyDriver first, second;
    first.give(&upper, false);
    second.give(&lower, false);
    list.push(&first, "first");
    list.push(&second, "second");
    options.fromString("(networks (first second)) (first (0 3 0 3)) (second (4 6 0 2)) (robotName r)", false);
    options.put("device", "virtualAnalogServer");
    return serve(options, list);
}
