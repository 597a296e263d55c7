// Stock's logger without its window: collects what programs forward, and prints it when a line arrives on standard input.
#include <yarp/logger/YarpLogger.h>
#include <yarp/os/Network.h>

#include <cstdio>
#include <iostream>
#include <string>

using yarp::os::Network;
using namespace yarp::yarpLogger;

int main()
{
    Network network;
    LoggerEngine logger("/yarplogger");
    if (!logger.start_logging()) {
        return 1;
    }
    std::puts("started");
    std::fflush(stdout);
    for (std::string line; std::getline(std::cin, line);) {
        if (line == "discover") {
            std::list<std::string> ports;
            logger.discover(ports);
            logger.connect(ports);
        }
        std::list<MessageEntry> all;
        logger.get_messages(all);
        for (const auto& each : all) {
            std::printf("entry|%s|%s|%s\n", each.level.toString().c_str(), each.component.c_str(), each.text.c_str());
        }
        std::list<LogEntryInfo> programs;
        logger.get_infos(programs);
        for (const auto& each : programs) {
            std::printf("program|%s|%s\n", each.process_name.c_str(), each.port_complete.c_str());
        }
        std::puts("end");
        std::fflush(stdout);
    }
    logger.stop_logging();
    return 0;
}
