// Speaks with what is ours alone, and with a controller of a tool as iCub's client does, from a program of stock YARP 4.0:
// plain bottles on plain ports, where the two generations write floats with the same codes and other meanings. Prints `ok` or
// `FAIL` per check. Ends with 1 if any check failed.
//
//     words_4 moves ARM        hears on ARM/async:o how moves end
//     words_4 hand HAND        calls HAND/hand/rpc:i
//     words_4 tool SERVER CARRIER      is a client of iCub's `cartesiancontrollerserver`, which goes over udp unless told
#include <yarp/os/Bottle.h>
#include <yarp/os/BufferedPort.h>
#include <yarp/os/Network.h>
#include <yarp/os/Port.h>
#include <yarp/os/RpcClient.h>
#include <yarp/os/Stamp.h>
#include <yarp/os/Time.h>
#include <yarp/sig/Vector.h>
#include <cmath>
#include <cstdio>
#include <functional>
#include <initializer_list>
#include <string>
using namespace yarp::os;

static const double PATIENCE = 60.0;
static int failures = 0;

static void check(const std::string& what, bool good, const std::string& found = "")
{
    if (!good) {
        failures++;
    }
    std::printf("%s %s%s%s\n", good ? "ok  " : "FAIL", what.c_str(), found.empty() ? "" : ": ", found.c_str());
    std::fflush(stdout);
}

static bool eventually(const std::function<bool()>& condition)
{
    const double end = Time::now() + PATIENCE;
    while (Time::now() < end) {
        if (condition()) {
            return true;
        }
        Time::delay(0.02);
    }
    return false;
}

static Bottle said(RpcClient& rpc, const std::string& text)
{
    Bottle reply;
    rpc.write(Bottle(text), reply);
    return reply;
}

static bool near(double found, double expected, double close = 0.02)
{
    return std::fabs(found - expected) < close;
}

// Reads with a port of stock's what an output of ours says.
template <class T>
static bool reads(BufferedPort<T>& port, const std::string& name, const std::string& source, const std::string& carrier)
{
    port.setStrict();
    return port.open(name) && Network::connect(source, name, carrier);
}

// The next bottle that begins with this word, and has this number behind it if it is not empty.
static Bottle hears(BufferedPort<Bottle>& port, const std::string& word, const std::string& number = "")
{
    Bottle found;
    eventually([&] {
        for (Bottle* next = port.read(false); next != nullptr; next = port.read(false)) {
            if (next->get(0).toString() == word && (number.empty() || next->get(1).toString() == number)) {
                found = *next;
                return true;
            }
        }
        return false;
    });
    return found;
}

static void moves(const std::string& arm)
{
    BufferedPort<Bottle> ends;
    check("async:o is read", reads(ends, "/words4/ends:i", arm + "/async:o", "tcp"));
    RpcClient rpc;
    rpc.open("/words4/moves:o");
    check("the arm can be asked", Network::connect(rpc.getName(), arm + "/rpc:i"));
    said(rpc, "[set] [icmd] [cmod] 0 [pos]");
    check("a speed", said(rpc, "[set] [vel] 0 20.0").toString() == "[ok]");
    Bottle reply = said(rpc, "[get] [vel] 0");
    check("it is told", reply.get(2).asFloat64() == 20.0, reply.toString());
    auto number = [&](const std::string& text) {
        Bottle reply = said(rpc, text);
        check("a move tells its number", reply.get(0).toString() == "move" && reply.get(1).isInt64(), reply.toString());
        return reply.get(1).toString();
    };
    const double start = said(rpc, "[get] [enc] 0").get(2).asFloat64();
    const double target = start > 0.0 ? start - 2.0 : start + 2.0;
    const std::string done = number("numb set pos 0 " + std::to_string(target));
    reply = hears(ends, "done", done);
    check("its end is heard", reply.toString() == "[done] " + done + " (0)", reply.toString());
    reply = said(rpc, "[get] [enc] 0");
    check("it is there", near(reply.get(2).asFloat64(), target), reply.toString());
    said(rpc, "[set] [vel] 0 0.01");
    const std::string first = number("numb set rel 0 1.5");
    const std::string second = number("numb set rel 0 -1.5");
    reply = hears(ends, "over", first);
    check("a newer move takes its place", reply.get(3).toString() == second, reply.toString());
    check("a stop", said(rpc, "[set] [sto] 0").toString() == "[ok]");
    check("the other was stopped", hears(ends, "stop", second).size() > 0);
    reply = said(rpc, "numb get " + second);
    check("which can be asked for", reply.toString() == "[stop] " + second + " (0)", reply.toString());
    said(rpc, "[set] [vel] 0 20.0");
    rpc.close();
    ends.close();
}

static void hand(const std::string& hand)
{
    RpcClient rpc;
    rpc.open("/words4/hand:o");
    check("the hand can be asked", Network::connect(rpc.getName(), hand + "/hand/rpc:i"));
    // Numbers are answered as text, and heard as floats of 4.0.
    Bottle move;
    move.addVocab32("hand");
    move.addVocab32("move");
    Bottle& fingers = move.addList();
    Bottle& degrees = move.addList();
    for (int finger : {0, 2}) {
        fingers.addInt32(finger);
        degrees.addFloat64(30.5 + finger);
    }
    Bottle reply;
    check("fingers move", rpc.write(move, reply) && reply.toString() == "[ok]", reply.toString());
    auto positions = [&] {
        reply = said(rpc, "[hand] [pos]");
        return Bottle(reply.get(1).asString());
    };
    Bottle now = positions();
    check("they are there", now.size() == 4 && near(now.get(0).asFloat64(), 30.5, 0.5) && near(now.get(2).asFloat64(), 32.5, 0.5), reply.toString());
    check("a grasp", said(rpc, "[hand] [gras] rect").toString() == "[ok]");
    check("its own language", said(rpc, "[hand] [gcl] \"4FGET P\"").toString() == "[ok] 1500" || said(rpc, "[hand] [gcl] \"4FGET P\"").get(1).asString() == "1500");
    check("it opens", said(rpc, "open").toString() == "[ok]");
    now = positions();
    check("and is open", now.size() == 4 && near(now.get(0).asFloat64(), 0.0, 0.5), reply.toString());
    reply = said(rpc, "[hand] [move] (0) (200.5)");
    check("too far is refused in words", reply.get(0).toString() == "fail" && reply.size() > 1, reply.toString());
    reply = said(rpc, "dance");
    check("so is an unknown word", reply.get(0).toString() == "fail", reply.toString());
    rpc.close();
}

// Seven numbers, each a float.
static bool isPose(const Value& value, yarp::sig::Vector& pose)
{
    const Bottle* list = value.asList();
    if (list == nullptr || list->size() != 7) {
        return false;
    }
    pose.resize(7);
    for (size_t i = 0; i < 7; i++) {
        if (!list->get(i).isFloat64()) {
            return false;
        }
        pose[i] = list->get(i).asFloat64();
    }
    return std::fabs(std::hypot(pose[3], std::hypot(pose[4], pose[5])) - 1.0) < 1e-6;
}

static void tool(const std::string& server, const std::string& carrier)
{
    // As iCub's client opens: the server is asked before the other ports are connected.
    RpcClient rpc;
    rpc.open("/words4/tool/rpc:o");
    check("the server can be asked", Network::connect(rpc.getName(), server + "/rpc:i"));
    Bottle reply = said(rpc, "[get] [info]");
    const Bottle* info = reply.get(1).asList();
    check("its version", info != nullptr && info->find("server_version").asString() == "2.0", reply.toString());
    check("its solver is there", said(rpc, "[get] [ison]").toString() == "[ack] [true]");
    Port command;
    BufferedPort<yarp::sig::Vector> state;
    BufferedPort<Bottle> events;
    command.open("/words4/tool/command:o");
    check("commands", Network::connect(command.getName(), server + "/command:i", carrier));
    check("poses", reads(state, "/words4/tool/state:i", server + "/state:o", carrier));
    check("events", reads(events, "/words4/tool/events:i", server + "/events:o", carrier));

    yarp::sig::Vector pose(7, 0.0);
    // The newest pose on state:o; the envelope has its time.
    auto newest = [&] {
        bool some = false;
        for (yarp::sig::Vector* next = state.read(false); next != nullptr; next = state.read(false)) {
            pose = *next;
            some = true;
        }
        return some;
    };
    auto arrives = [&](const std::string& what, double x, double y, double z) {
        const bool there = eventually([&] {
            return newest() && pose.size() == 7 && near(pose[0], x) && near(pose[1], y) && near(pose[2], z);
        });
        check(what, there, pose.toString());
    };
    const bool comes = eventually(newest);
    check("a pose comes", comes && pose.size() == 7 && std::fabs(pose[0]) < 2.0, pose.toString());
    Stamp stamp;
    check("with its time", state.getEnvelope(stamp) && stamp.getTime() > 1e9);

    check("the time of ways", said(rpc, "[get] [time]").get(1).isFloat64());
    check("is set", said(rpc, "[set] [time] 1.25").toString() == "[ack]" && said(rpc, "[get] [time]").get(1).asFloat64() == 1.25);
    reply = said(rpc, "[get] [lim] 1");
    check("limits", reply.size() == 3 && near(reply.get(1).asFloat64(), -114.59) && near(reply.get(2).asFloat64(), 114.59), reply.toString());
    reply = said(rpc, "[set] [dof] (1 1 2 2 1 1 1)");
    check("joints that take part", reply.toString() == "[ack] (1 1 1 1 1 1 1)", reply.toString());
    reply = said(rpc, "[stor]");
    const std::string context = reply.get(1).toString();
    check("a context is stored", reply.get(0).toString() == "ack", reply.toString());

    reply = said(rpc, "[ask] ([xd] (0.4 0.1 0.4)) ([pose] [xyz])");
    yarp::sig::Vector asked;
    const Bottle* joints = reply.find("q").asList();
    const Bottle* found = reply.get(1).asList();
    check("what would be reached", found != nullptr && isPose(found->get(1), asked) && near(asked[0], 0.4) && near(asked[1], 0.1) && near(asked[2], 0.4), reply.toString());
    check("by which joints", joints != nullptr && joints->size() == 7);
    check("a point of the way is registered", said(rpc, "[even] [regi] [ogoi] 0.5").toString() == "[ack]");
    reply = said(rpc, "[even] [list] [ogoi]");
    check("and listed", reply.get(1).asList() != nullptr && reply.get(1).asList()->get(0).asFloat64() == 0.5, reply.toString());

    Bottle go("[go] [xyz] 1.5 (0.4 0.1 0.4)");
    check("a position is asked for", command.write(go));
    for (const char* event : {"motion-onset", "motion-ongoing", "motion-done"}) {
        Bottle news = hears(events, event);
        const bool timed = news.get(1).isFloat64() && std::fabs(news.get(1).asFloat64() - Time::now()) < 2.0 * PATIENCE;
        check(event, timed && (news.size() == 2 || news.get(2).asFloat64() == 0.5), news.toString());
    }
    arrives("the tool is there", 0.4, 0.1, 0.4);
    reply = said(rpc, "[get] [des]");
    found = reply.get(1).asList();
    check("what was wanted", found != nullptr && isPose(found->get(1), asked) && near(asked[0], 0.4), reply.toString());

    Bottle full("[go] [full] 1.5 ()");
    Bottle& target = *full.get(3).asList();
    for (size_t i = 0; i < 7; i++) {
        target.addFloat64(i == 2 ? 0.45 : pose[i]);
    }
    check("a whole pose is asked for", command.write(full));
    arrives("it gets there", 0.4, 0.1, 0.45);
    check("and says so", hears(events, "motion-done").size() == 2);

    reply = said(rpc, "[go] [xyz] 1.5 (0.4 0.0 0.4)");
    check("a position with an answer", reply.toString() == "[ack]", reply.toString());
    arrives("leads there", 0.4, 0.0, 0.4);
    check("and is done", eventually([&] { return said(rpc, "[get] [done]").toString() == "[ack] [true]"; }));

    Bottle velocity("[tvel] (0.0 0.05 0.0 0.0 0.0 0.0 0.0)");
    check("a velocity is asked for", command.write(velocity));
    const bool moving = eventually([&] { return newest() && pose[1] > 0.03; });
    check("it moves that way", moving, pose.toString());
    const bool fast = eventually([&] {
        reply = said(rpc, "[get] [xdot]");
        const Bottle* speed = reply.get(1).asList();
        return speed != nullptr && speed->size() == 7 && near(speed->get(1).asFloat64(), 0.05);
    });
    check("at that velocity", fast, reply.toString());
    check("a stop", said(rpc, "[stop]").toString() == "[ack]");
    check("the context comes back", said(rpc, "[rest] " + context).toString() == "[ack]" && said(rpc, "[del] (" + context + ")").toString() == "[ack]");
    check("what is malformed is refused", said(rpc, "[go] [xyz] 1.5 (0.4 0.1)").toString() == "[nack]");
    command.close();
    state.close();
    events.close();
    rpc.close();
}

int main(int argc, char** argv)
{
    Network network;
    if (argc < 3) {
        return 2;
    }
    const std::string what = argv[1];
    if (what == "moves") {
        moves(argv[2]);
    } else if (what == "hand") {
        hand(argv[2]);
    } else if (what == "tool") {
        tool(argv[2], argc > 3 ? argv[3] : "udp");
    } else {
        return 2;
    }
    return failures == 0 ? 0 : 1;
}
