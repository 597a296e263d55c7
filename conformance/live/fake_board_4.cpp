// Serves stock 4.0 fakeMotionControl of three axes by stock controlBoard_nws_yarp, for so many seconds.
//
//     fake_board_4 NAME SECONDS
#include <yarp/os/Network.h>
#include <yarp/os/Property.h>
#include <yarp/os/Time.h>
#include <yarp/dev/PolyDriver.h>
#include <yarp/dev/IMultipleWrapper.h>
#include <yarp/dev/WrapperSingle.h>
#include <cstdio>
#include <cstdlib>
using namespace yarp::os; using namespace yarp::dev;
int main(int argc, char** argv) {
    Network network;
    Property a; a.fromString("(device fakeMotionControl) (GENERAL (Joints 3) (AxisName (joint0 joint1 joint2)))");
    Property b; b.put("device", "controlBoard_nws_yarp"); b.put("name", argv[1]);
    PolyDriver fake, nws;
    if (!fake.open(a) || !nws.open(b)) return 1;
    IWrapper* one = nullptr; IMultipleWrapper* many = nullptr;
    if (nws.view(one) && one) { if (!one->attach(&fake)) return 2; }
    else if (nws.view(many) && many) { PolyDriverList list; list.push(&fake, "fake"); if (!many->attachAll(list)) return 3; }
    else return 4;
    std::printf("serving %s\n", argv[1]); std::fflush(stdout);
    Time::delay(atof(argv[2]));
    nws.close(); fake.close();
}
