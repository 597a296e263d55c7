// Drives a served arm with the client of stock YARP 4.0, `controlBoard_nwc_yarp`, and prints `ok` or `FAIL` per call.
//
// The device is compiled in, since installations need not have it as a plugin; run_4.sh does that. Ends with 1 if any
// check failed.
//
//     control_board_4 REMOTE LOCAL [CARRIER]
#include <yarp/os/Network.h>
#include <yarp/os/Property.h>
#include <yarp/os/Time.h>
#include <yarp/os/Bottle.h>
#include <yarp/dev/PidEnums.h>
#include "ControlBoard_nwc_yarp.h"
#include <cstdio>
#include <vector>
#include <functional>
#include <cmath>
using namespace yarp::os; using namespace yarp::dev;
static int failures = 0;
static void check(const char* what, bool good) { if (!good) failures++; std::printf("%s %s\n", good ? "ok  " : "FAIL", what); std::fflush(stdout); }
static bool eventually(std::function<bool()> f) { double end = Time::now() + 15; while (Time::now() < end) { if (f()) return true; Time::delay(0.01);} return false; }
int main(int argc, char** argv) {
    Network network;
    ControlBoard_nwc_yarp board;
    Property options;
    options.put("remote", argv[1]); options.put("local", argv[2]);
    options.put("carrier", argc > 3 ? argv[3] : "fast_tcp");
    options.put("carrier_cmd", argc > 3 ? argv[3] : "fast_tcp");
    bool open = board.open(options);
    check("opens", open);
    if (!open) return 1;
    size_t n = 0; board.getAxes(n); check("axes", n >= 2);
    std::string name; check("axis name", bool(board.getAxisName(0, name)) && !name.empty());
    JointTypeEnum type; check("joint type", bool(board.getJointType(0, type)));
    std::vector<double> v(n), w(n);
    check("encoders", eventually([&]{ return bool(board.getEncoders(v.data())); }));
    std::vector<SelectableControlModeEnum> available;
    check("available modes", bool(board.getAvailableControlModes(0, available)) && !available.empty());
    auto mode = [&](int j, SelectableControlModeEnum m) {
        if (!board.setControlMode(j, m)) return false;
        return eventually([&]{ ControlModeEnum now; return bool(board.getControlMode(j, now)) && int(now) == int(m); });
    };
    double lo, hi;
    check("position limits", bool(board.getPosLimits(0, &lo, &hi)) && lo < hi);
    check("velocity limits", bool(board.getVelLimits(0, &lo, &hi)));
    check("position mode", mode(0, SelectableControlModeEnum::VOCAB_CM_POSITION));
    double start; check("encoder", bool(board.getEncoder(0, &start)));
    check("traj speed", bool(board.setTrajSpeed(0, 20.0)));
    double x = 0; check("traj speed back", bool(board.getTrajSpeed(0, &x)) && x == 20.0);
    check("traj acceleration", bool(board.setTrajAcceleration(0, 60.0)) && bool(board.getTrajAcceleration(0, &x)) && x == 60.0);
    check("the acceleration of yarpmotorgui", bool(board.setTrajAcceleration(0, 100000.0)) && bool(board.getTrajAcceleration(0, &x)) && x > 60.0 && x < 100000.0);
    check("position move", bool(board.positionMove(0, start + 3.0)));
    check("target", bool(board.getTargetPosition(0, &x)) && std::fabs(x - start - 3.0) < 1e-9);
    check("it arrives", eventually([&]{ double p; return bool(board.getEncoder(0, &p)) && std::fabs(p - start - 3.0) < 1e-3; }));
    bool done = false; check("motion done", bool(board.checkMotionDone(0, done)));
    int joints[2] = {0, 1}; double two[2] = {start + 2.0, 0}; board.getEncoder(1, &two[1]);
    check("group move", bool(board.positionMove(2, joints, two)));
    check("relative move", bool(board.relativeMove(0, 1.0)));
    check("stop", bool(board.stop(0)) && bool(board.stop()));
    check("velocity mode", mode(0, SelectableControlModeEnum::VOCAB_CM_VELOCITY));
    check("velocity move", bool(board.velocityMove(0, 5.0)));
    check("target velocity", eventually([&]{ double t; return bool(board.getTargetVelocity(0, &t)) && t == 5.0; }));
    double here; board.getEncoder(0, &here);
    check("it moves", eventually([&]{ double p; return bool(board.getEncoder(0, &p)) && p > here + 1.0; }));
    board.stop(0);
    check("velocity direct mode", mode(0, SelectableControlModeEnum::VOCAB_CM_VELOCITY_DIRECT));
    check("direct velocity", bool(board.setRefVelocity(0, -5.0)));
    check("direct velocity back", eventually([&]{ double t; return bool(board.getRefVelocity(0, t)) && t == -5.0; }));
    board.setRefVelocity(0, 0.0);
    check("position direct mode", mode(0, SelectableControlModeEnum::VOCAB_CM_POSITION_DIRECT));
    board.getEncoder(0, &here);
    check("direct position", bool(board.setPosition(0, here + 1.0)));
    check("it follows", eventually([&]{ double p; return bool(board.getEncoder(0, &p)) && std::fabs(p - here - 1.0) < 1e-3; }));
    check("direct position back", bool(board.getRefPosition(0, &x)) && std::fabs(x - here - 1.0) < 1e-9);
    check("torque mode", mode(0, SelectableControlModeEnum::VOCAB_CM_TORQUE));
    check("torque range", bool(board.getTorqueRange(0, &lo, &hi)) && lo < hi);
    check("torque", bool(board.setRefTorque(0, hi / 10)));
    check("torque back", eventually([&]{ double t; return bool(board.getRefTorque(0, &t)) && std::fabs(t - hi / 10) < 1e-9; }));
    check("torque measured", eventually([&]{ double t; return bool(board.getTorque(0, &t)); }));
    check("torques measured", bool(board.getTorques(v.data())));
    MotorTorqueParameters mtp; check("motor torque parameters", bool(board.getMotorTorqueParams(0, &mtp)) && bool(board.setMotorTorqueParams(0, mtp)));
    check("current mode", mode(0, SelectableControlModeEnum::VOCAB_CM_CURRENT));
    check("current range", bool(board.getCurrentRange(0, &lo, &hi)));
    check("current ranges", bool(board.getCurrentRanges(v.data(), w.data())));
    check("current", bool(board.setRefCurrent(0, 0.1)));
    check("current back", bool(board.getRefCurrent(0, &x)) && x == 0.1);
    check("current measured", bool(board.getCurrent(0, &x)) && bool(board.getCurrents(v.data())));
    check("pwm mode", mode(0, SelectableControlModeEnum::VOCAB_CM_PWM));
    check("duty cycle", bool(board.setRefDutyCycle(0, 3.0)));
    check("duty cycle back", bool(board.getRefDutyCycle(0, &x)) && x == 3.0);
    check("duty cycle measured", eventually([&]{ double t; return bool(board.getDutyCycle(0, &t)) && std::fabs(t - 3.0) < 1e-3; }));
    check("duty cycles", bool(board.getDutyCycles(v.data())));
    check("idle mode", mode(0, SelectableControlModeEnum::VOCAB_CM_IDLE));
    check("position mode again", mode(0, SelectableControlModeEnum::VOCAB_CM_POSITION));
    check("interaction", bool(board.setInteractionMode(0, InteractionModeEnum::VOCAB_IM_COMPLIANT)));
    check("interaction back", eventually([&]{ InteractionModeEnum m; return bool(board.getInteractionMode(0, m)) && m == InteractionModeEnum::VOCAB_IM_COMPLIANT; }));
    board.setInteractionMode(0, InteractionModeEnum::VOCAB_IM_STIFF);
    double d = 0;
    check("impedance", bool(board.setImpedance(0, 1.5, 0.5)) && bool(board.getImpedance(0, &x, &d)) && x == 1.5 && d == 0.5);
    check("impedance offset", bool(board.setImpedanceOffset(0, 0.25)) && bool(board.getImpedanceOffset(0, &x)) && x == 0.25);
    double a, b, c, e; check("impedance limits", bool(board.getCurrentImpedanceLimit(0, &a, &b, &c, &e)) && a <= b && c <= e);
    auto P = PidControlTypeEnum::VOCAB_PIDTYPE_POSITION;
    std::vector<PidControlTypeEnum> kinds; check("available pids", bool(board.getAvailablePids(0, kinds)) && !kinds.empty());
    Pid pid, back; pid.kp=1; pid.kd=2; pid.ki=3; pid.max_int=4; pid.scale=5; pid.max_output=6; pid.offset=7; pid.stiction_up_val=8; pid.stiction_down_val=9; pid.kff=10;
    check("pid", bool(board.setPid(P, 0, pid)) && bool(board.getPid(P, 0, &back)) && back == pid);
    std::vector<Pid> pids(n); check("pids", bool(board.getPids(P, pids.data())) && pids[0] == pid && bool(board.setPids(P, pids.data())));
    PidExtraInfo info; check("pid extra info", bool(board.getPidExtraInfo(P, 0, info)) && !info.description.pid_description.empty() && info.description.input_data_description == "position, deg" && info.description.output_data_description == "duty cycle, %" && info.units.units_kp == "%/deg" && info.units.units_scale.empty() && info.units.units_kff == "%");
    std::vector<PidExtraInfo> infos; check("pid extra infos", bool(board.getPidExtraInfos(PidControlTypeEnum::VOCAB_PIDTYPE_TORQUE_1, infos)) && infos.size() == n && infos[n - 1].description.input_data_description == "torque, Nm" && infos[n - 1].units.units_kp == "%/Nm");
    check("no third loop", !board.getPidExtraInfo(PidControlTypeEnum::VOCAB_PIDTYPE_POSITION_3, 0, info));
    check("pid reference", bool(board.setPidReference(P, 0, 1.5)) && bool(board.getPidReference(P, 0, &x)) && x == 1.5);
    check("pid references", bool(board.getPidReferences(P, v.data())) && v[0] == 1.5);
    check("pid error limit", bool(board.setPidErrorLimit(P, 0, 2.5)) && bool(board.getPidErrorLimit(P, 0, &x)) && x == 2.5);
    check("pid errors", bool(board.getPidError(P, 0, &x)) && bool(board.getPidErrors(P, v.data())));
    check("pid outputs", bool(board.getPidOutput(P, 0, &x)) && bool(board.getPidOutputs(P, v.data())));
    check("pid offset", bool(board.setPidOffset(P, 0, 0.5)));
    check("pid offset back", eventually([&]{ double t; return bool(board.getPidOffset(P, 0, t)) && t == 0.5; }));
    check("pid feedforward", bool(board.setPidFeedforward(P, 0, 0.75)));
    check("pid feedforward back", eventually([&]{ double t; return bool(board.getPidFeedforward(P, 0, t)) && t == 0.75; }));
    bool on = true; check("disable pid", bool(board.disablePid(P, 0)) && bool(board.isPidEnabled(P, 0, on)) && !on);
    check("enable pid", bool(board.enablePid(P, 0)) && bool(board.isPidEnabled(P, 0, on)) && on);
    check("reset pid", bool(board.resetPid(P, 0)));
    int motors = 0; check("motor encoders", bool(board.getNumberOfMotorEncoders(&motors)) && motors == int(n));
    check("set motor encoder", bool(board.setMotorEncoder(0, 100.0)));
    check("motor encoder", eventually([&]{ double t; return bool(board.getMotorEncoder(0, &t)) && std::fabs(t - 100.0) < 1e-6; }));
    check("motor encoders of all", bool(board.getMotorEncoders(v.data())) && bool(board.resetMotorEncoder(0)));
    check("motor counts", bool(board.setMotorEncoderCountsPerRevolution(0, 1000)) && bool(board.getMotorEncoderCountsPerRevolution(0, &x)) && x == 1000);
    int number = 0;
    check("motors", bool(board.getNumberOfMotors(&number)) && number == int(n));
    check("temperature", bool(board.getTemperature(0, &x)));
    check("temperature limit", bool(board.setTemperatureLimit(0, 70)) && bool(board.getTemperatureLimit(0, &x)) && x == 70);
    check("gearbox ratio", bool(board.setGearboxRatio(0, 20)) && bool(board.getGearboxRatio(0, &x)) && x == 20);
    int status = 0; check("amp status", bool(board.getAmpStatus(0, &status)));
    std::vector<int> all(n); check("amp status of all", bool(board.getAmpStatus(all.data())));
    check("max current", bool(board.getMaxCurrent(0, &x)) && bool(board.setMaxCurrent(0, x / 2)));
    check("nominal current", bool(board.getNominalCurrent(0, &x)) && bool(board.setNominalCurrent(0, x / 2)));
    check("peak current", bool(board.getPeakCurrent(0, &x)) && bool(board.setPeakCurrent(0, x / 2)));
    check("pwm limit", bool(board.getPWMLimit(0, &x)) && bool(board.setPWMLimit(0, 50.0)));
    check("pwm, supply", bool(board.getPWM(0, &x)) && bool(board.getPowerSupplyVoltage(0, &x)));
    check("disable amp", bool(board.disableAmp(0)) && bool(board.enableAmp(0)));
    check("position mode", mode(0, SelectableControlModeEnum::VOCAB_CM_POSITION));
    check("calibrate axis", eventually([&]{ return bool(board.calibrateAxisWithParams(0, 3, 1, 2, 3)); }));
    check("calibration done", bool(board.calibrationDone(0)));
    check("calibrate robot", bool(board.calibrateRobot()));
    check("park", bool(board.park(false)) && bool(board.abortPark()) && bool(board.abortCalibration()));
    bool present = false; check("calibrator", bool(board.isCalibratorDevicePresent(&present)) && present);
    check("homing", bool(board.homingSingleJoint(0)) && bool(board.homingWholePart()));
    check("quit", bool(board.quitPark()) && bool(board.quitCalibrate()));
    check("parking", bool(board.parkSingleJoint(0, false)) && bool(board.parkWholePart()) && bool(board.quitPark()));
    Bottle keys; check("variables", bool(board.getRemoteVariablesList(&keys)) && keys.size() >= 1);
    std::printf("     %s\n", keys.toString().c_str());
    Bottle value; check("variable", bool(board.getRemoteVariable("friction", value)) && value.size() == n);
    std::printf("     %s\n", value.toString().c_str());
    check("set variable", bool(board.setRemoteVariable("friction", value)));
    int fault = -1; std::string message; check("fault", bool(board.getLastJointFault(0, fault, message)) && fault == 0 && !message.empty());
    bool braked = true; check("brake", bool(board.isJointBraked(0, braked)) && !braked);
    check("manual brake", bool(board.setManualBrakeActive(0, true)) && bool(board.isJointBraked(0, braked)) && braked);
    check("a braked joint refuses", !board.positionMove(0, 1.0));
    check("brake off", bool(board.setManualBrakeActive(0, false)));
    bool automatic = false; check("auto brake", bool(board.setAutoBrakeEnabled(0, true)) && bool(board.getAutoBrakeEnabled(0, automatic)) && automatic && bool(board.setAutoBrakeEnabled(0, false)));
    check("out of range is refused", !board.positionMove(0, 1e6));
    check("a missing joint is refused", !board.positionMove(int(n), 0.0));
    check("reset encoder", eventually([&]{ return bool(board.setEncoder(0, 1.0)); }));
    board.close();
    std::printf("%d failed\n", failures);
    return failures != 0;
}
