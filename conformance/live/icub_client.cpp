// Moves the tool of a served arm with iCub's own client, `cartesiancontrollerclient` of icub-main 1.21 on stock YARP 3.5,
// and prints `ok` or `FAIL` per call: every call of `yarp::dev::ICartesianControl`.
//
// The device is compiled in; run_icub.sh does that. Ends with 1 if any check failed.
//
//     icub_client REMOTE LOCAL CARRIER
#include <atomic>
#include <cmath>
#include <cstdio>
#include <functional>
#include <string>

#include <yarp/math/Math.h>
#include <yarp/os/Bottle.h>
#include <yarp/os/Network.h>
#include <yarp/os/Property.h>
#include <yarp/os/Time.h>

#include "ClientCartesianController.h"

using namespace yarp::os;
using yarp::math::norm;
using yarp::sig::Vector;

static int failures = 0;

static void check(const char* what, bool good)
{
    failures += !good;
    std::printf("%s %s\n", good ? "ok  " : "FAIL", what);
    std::fflush(stdout);
}

static bool eventually(const std::function<bool()>& holds)
{
    for (double end = Time::now() + 15; Time::now() < end; Time::delay(0.02)) {
        if (holds()) { return true; }
    }
    return false;
}

// Counts the events that it is registered for.
struct Counter : yarp::dev::CartesianEvent
{
    std::atomic<int> seen{0};
    explicit Counter(const char* type) { cartesianEventParameters.type = type; }
    void cartesianEventCallback() override { ++seen; }
};

int main(int argc, char** argv)
{
    if (argc != 4) { return 2; }
    Network network;
    ClientCartesianController tool;
    Property options;
    options.put("remote", argv[1]);
    options.put("local", argv[2]);
    options.put("carrier", argv[3]);
    bool open = tool.open(options);
    check("opens, with server, solver and all four ports", open);
    if (!open) { return 1; }

    Vector x, o, xd, od, q, qd;
    auto near = [&](const Vector& goal) { return tool.getPose(x, o) && norm(x - goal) < 5e-3; };
    check("getPose", eventually([&] { return tool.getPose(x, o); }) && x.size() == 3 && o.size() == 4);
    check("getPose of an axis", tool.getPose(2, xd, od) && xd.size() == 3 && od.size() == 4);
    check("getPose of an axis beyond is refused", !tool.getPose(70, xd, od));
    Bottle info;
    check("getInfo", tool.getInfo(info) && info.check("server_version") && info.check("events"));

    Vector dof, rest, weights;
    check("getDOF", tool.getDOF(dof) && dof.size() == 7);
    check("setDOF", tool.setDOF(dof, xd) && xd.size() == 7);
    check("getRestPos", tool.getRestPos(rest) && rest.size() == 7);
    check("setRestPos", tool.setRestPos(rest, xd) && xd.size() == 7);
    check("getRestWeights", tool.getRestWeights(weights) && weights.size() == 7);
    check("setRestWeights", tool.setRestWeights(weights, xd) && xd.size() == 7);
    double low = 0, high = 0, number = 0;
    check("getLimits", tool.getLimits(0, &low, &high) && low < high);
    check("setLimits", tool.setLimits(0, low, high));
    check("setTrajTime", tool.setTrajTime(1.25) && tool.getTrajTime(&number) && number == 1.25);
    check("setInTargetTol", tool.setInTargetTol(0.002) && tool.getInTargetTol(&number) && number == 0.002);
    bool flag = true;
    check("setTrackingMode", tool.setTrackingMode(false) && tool.getTrackingMode(&flag) && !flag);
    std::string priority;
    check("setPosePriority", tool.setPosePriority("position") && tool.getPosePriority(priority) && priority == "position");
    int context = -1;
    check("storeContext", tool.storeContext(&context) && context >= 0);

    Vector home = x, there(3), up(4);
    there[0] = 0.45, there[1] = 0.1, there[2] = 0.4;
    check("askForPosition", tool.askForPosition(there, xd, od, qd) && norm(xd - there) < 5e-3 && qd.size() == 7);
    check("askForPosition from joints", tool.askForPosition(qd, there, xd, od, qd) && norm(xd - there) < 5e-3);
    up = od;
    check("askForPose", tool.askForPose(there, up, xd, od, qd) && norm(xd - there) < 5e-3);
    check("askForPose from joints", tool.askForPose(qd, there, up, xd, od, qd) && norm(xd - there) < 5e-3);

    Counter onset("motion-onset"), done("motion-done");
    check("registerEvent", tool.registerEvent(onset) && tool.registerEvent(done));
    check("goToPositionSync", tool.goToPositionSync(there, 1.0));
    check("checkMotionDone in motion", tool.checkMotionDone(&flag) && !flag);
    check("getDesired", tool.getDesired(xd, od, qd) && norm(xd - there) < 5e-3 && qd.size() == 7);
    check("getJointsVelocities", eventually([&] { return tool.getJointsVelocities(qd) && qd.size() == 7 && norm(qd) > 0; }));
    check("getTaskVelocities", tool.getTaskVelocities(xd, od) && xd.size() == 3 && od.size() == 4);
    check("waitMotionDone", tool.waitMotionDone(0.05, 15));
    check("it is there", near(there));
    check("the events come", eventually([&] { return onset.seen > 0 && done.seen > 0; }));
    check("unregisterEvent", tool.unregisterEvent(onset) && tool.unregisterEvent(done));

    // Told on the command port, without an answer.
    there[2] = 0.45;
    check("goToPosition", tool.goToPosition(there, 1.0) && eventually([&] { return near(there); }));
    tool.getPose(x, o);
    there[1] = 0.05;
    check("goToPose", tool.goToPose(there, o, 1.0) && eventually([&] { return near(there); }));
    check("it kept its orientation", tool.getPose(x, od) && std::fabs(std::fabs(od[3]) - std::fabs(o[3])) < 0.05);
    there[1] = 0.1;
    check("goToPoseSync", tool.goToPoseSync(there, o, 1.0) && tool.waitMotionDone(0.05, 15) && near(there));

    check("goToPositionSync, to be stopped", tool.goToPositionSync(home, 8.0));
    check("stopControl", tool.stopControl() && tool.checkMotionDone(&flag) && flag && !near(home));
    check("setTrackingMode, on", tool.setTrackingMode(true) && tool.getTrackingMode(&flag) && flag);
    check("it follows a target", tool.goToPosition(there, 1.0) && eventually([&] { return near(there); }));
    check("stopControl while it tracks", tool.stopControl());

    Vector speed(3, 0.0), turn(4, 0.0);
    speed[2] = 0.05, turn[2] = 1.0;
    tool.getPose(x, o);
    double before = x[2];
    check("setTaskVelocities", tool.setTaskVelocities(speed, turn) && eventually([&] {
        return tool.getPose(x, o) && x[2] > before + 0.01;
    }));
    check("stopControl after it", tool.stopControl());

    Vector tip(3, 0.0), straight(4, 0.0);
    tip[2] = 0.1, straight[2] = 1.0;
    check("attachTipFrame", tool.attachTipFrame(tip, straight) && tool.getTipFrame(xd, od) && norm(xd - tip) < 1e-6);
    check("removeTipFrame", tool.removeTipFrame() && tool.getTipFrame(xd, od) && norm(xd) < 1e-6);
    check("setReferenceMode", tool.setReferenceMode(true) && tool.getReferenceMode(&flag) && flag && tool.setReferenceMode(false));
    check("restoreContext", tool.restoreContext(context) && tool.getTrackingMode(&flag) && !flag);
    check("deleteContext", tool.deleteContext(context) && !tool.restoreContext(context));
    Bottle tweak;
    check("tweakGet", tool.tweakGet(tweak));
    check("tweakSet of nothing that there is", !tool.tweakSet(Bottle("(flux 1)")));
    check("closes", tool.close());
    std::printf("%d failures\n", failures);
    return failures != 0;
}
