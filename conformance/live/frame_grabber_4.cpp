// Looks through a camera of ours with the client of stock YARP 4.0, `frameGrabber_nwc_yarp`, and prints `ok` or `FAIL`
// per check; or serves stock's `fakeFrameGrabber` by stock's `frameGrabber_nws_yarp`, for so many seconds.
//
// Both wrappers are plugins; the fake camera is compiled in. run_4.sh does that. Ends with 1 if any check failed.
//
//     frame_grabber_4 look NAME LOCAL
//     frame_grabber_4 wire NAME LOCAL      (a camera on IEEE 1394)
//     frame_grabber_4 serve NAME SECONDS
#include "FakeFrameGrabber.h"
#include <yarp/dev/Drivers.h>
#include <yarp/dev/PolyDriver.h>
#include <yarp/dev/WrapperSingle.h>
#include <yarp/os/Network.h>
#include <yarp/os/Property.h>
#include <yarp/os/Time.h>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <string>
using namespace yarp::os; using namespace yarp::dev; using namespace yarp::sig;
static int failures = 0;
static void check(const char* what, bool good) { if (!good) failures++; std::printf("%s %s\n", good ? "ok  " : "FAIL", what); std::fflush(stdout); }
static bool eventually(std::function<bool()> f) { double end = Time::now() + 20; while (Time::now() < end) { if (f()) return true; Time::delay(0.02);} return false; }
static bool grid(const ImageOf<PixelRgb>& i) {
    return i.width() == 32 && i.height() == 24 && i.pixel(31, 0).r == 255 && i.pixel(0, 0).r == 0 && i.pixel(0, 23).g == 255;
}
static bool white(const ImageOf<PixelRgb>& i) { return i.width() > 0 && i.pixel(0, 0).r == 255 && i.pixel(0, 0).g == 255; }

static void look(const std::string& name, const std::string& local, bool stream) {
    Property options; options.put("device", "frameGrabber_nwc_yarp"); options.put("remote", name); options.put("local", local);
    if (!stream) options.put("no_stream", Value(true));
    PolyDriver driver;
    check(stream ? "opens" : "opens without a stream", driver.open(options));
    if (!driver.isValid()) return;
    IFrameGrabberImage* images = nullptr; IFrameGrabberControls* knobs = nullptr; IRgbVisualParams* view = nullptr;
    check("interfaces", driver.view(images) && driver.view(knobs) && driver.view(view));
    if (!images || !knobs || !view) return;
    ImageOf<PixelRgb> image;
    // Before the first image has come, stock's getImage copies from nowhere, and nothing tells when it has.
    Time::delay(2.0);
    auto shows = [&](bool (*good)(const ImageOf<PixelRgb>&)) { return bool(images->getImage(image)) && good(image); };
    check("the grid", eventually([&]{ return shows(grid); }));
    check("size", eventually([&]{ return images->width() == 32 && images->height() == 24; }));
    ImageOf<PixelRgb> part;
    check("a part", bool(images->getImageCrop(YARP_CROP_RECT, {vertex_t(1, 2), vertex_t(4, 3)}, part)) && part.width() == 4 && part.height() == 2);
    CameraDescriptor about; check("description", bool(knobs->getCameraDescription(about)) && !about.deviceDescription.empty());
    auto brightness = cameraFeature_id_t::YARP_FEATURE_BRIGHTNESS, gain = cameraFeature_id_t::YARP_FEATURE_GAIN;
    auto balance = cameraFeature_id_t::YARP_FEATURE_WHITE_BALANCE, zoom = cameraFeature_id_t::YARP_FEATURE_ZOOM;
    bool yes = false;
    check("brightness is there", bool(knobs->hasFeature(brightness, yes)) && yes);
    check("zoom is not", bool(knobs->hasFeature(zoom, yes)) && !yes);
    check("off and on", bool(knobs->hasOnOff(gain, yes)) && yes);
    check("by hand", bool(knobs->hasManual(gain, yes)) && yes);
    check("not by itself", bool(knobs->hasAuto(gain, yes)) && !yes && bool(knobs->hasOnePush(gain, yes)) && !yes);
    double x = 0, y = 0;
    check("gain", bool(knobs->setFeature(gain, 0.25)) && bool(knobs->getFeature(gain, x)) && x == 0.25 && bool(knobs->setFeature(gain, 0.0)));
    check("balance", bool(knobs->setFeature(balance, 0.25, 0.75)) && bool(knobs->getFeature(balance, x, y)) && x == 0.25 && y == 0.75 && bool(knobs->setFeature(balance, 0.5, 0.5)));
    check("zoom is refused", !knobs->setFeature(zoom, 0.5) && !knobs->getFeature(zoom, x));
    check("7 is refused", !knobs->setFeature(gain, 7.0));
    check("bright", bool(knobs->setFeature(brightness, 1.0)) && eventually([&]{ return shows(white); }));
    check("off", bool(knobs->setActive(brightness, false)) && eventually([&]{ return shows(grid); }) && bool(knobs->getActive(brightness, yes)) && !yes);
    check("back", bool(knobs->setFeature(brightness, 0.5)) && bool(knobs->setActive(brightness, true)));
    FeatureMode mode; check("mode", bool(knobs->getMode(gain, mode)) && mode == FeatureMode::MODE_MANUAL && bool(knobs->setMode(gain, mode)));
    check("one push is refused", !knobs->setOnePush(gain));
    check("rgb size", view->getRgbWidth() == 32 && view->getRgbHeight() == 24);
    std::vector<CameraConfig> all; check("configurations", bool(view->getRgbSupportedConfigurations(all)) && all.size() > 1 && all[0].width == 32 && all[0].framerate == 30.0 && all[0].pixelCoding == VOCAB_PIXEL_RGB);
    int w = 0, h = 0; check("resolution", bool(view->getRgbResolution(w, h)) && w == 32 && h == 24);
    check("larger", bool(view->setRgbResolution(40, 30)) && eventually([&]{ return bool(images->getImage(image)) && image.width() == 40; }) && bool(view->setRgbResolution(32, 24)));
    check("view", bool(view->setRgbFOV(50.5, 40.0)) && bool(view->getRgbFOV(x, y)) && x == 50.5 && y == 40.0);
    Property lens; check("lens", bool(view->getRgbIntrinsicParam(lens)) && lens.find("focalLengthX").asFloat64() > 0);
    check("mirrored", bool(view->setRgbMirroring(true)) && bool(view->getRgbMirroring(yes)) && yes && bool(view->setRgbMirroring(false)));
    IFrameGrabberControlsDC1394* wire = nullptr; unsigned value = 0;
    if (driver.view(wire) && wire) check("IEEE 1394 is refused", !wire->getVideoModeDC1394(value) && !wire->setFPSDC1394(1));
    check("the grid again", eventually([&]{ return shows(grid); }));
    driver.close();
}

static void wired(const std::string& name, const std::string& local) {
    Property options; options.put("device", "frameGrabber_nwc_yarp"); options.put("remote", name); options.put("local", local);
    PolyDriver driver; IFrameGrabberControlsDC1394* wire = nullptr; IFrameGrabberControls* knobs = nullptr; IFrameGrabberImage* images = nullptr;
    check("opens", driver.open(options));
    if (!driver.view(wire) || !driver.view(knobs) || !driver.view(images)) { check("interfaces", false); return; }
    Time::delay(2.0);
    ImageOf<PixelRgb> image;
    auto becomes = [&](size_t w, size_t h) { return eventually([&]{ return bool(images->getImage(image)) && image.width() == w && image.height() == h; }); };
    CameraDescriptor about; check("its bus", bool(knobs->getCameraDescription(about)) && about.busType == BusType::BUS_FIREWIRE);
    unsigned v = 0;
    check("video modes", bool(wire->getVideoModeMaskDC1394(v)) && v == ((1u << 0) | (1u << 1) | (1u << 4) | (1u << 24)));
    check("video mode", bool(wire->setVideoModeDC1394(1)) && bool(wire->getVideoModeDC1394(v)) && v == 1 && becomes(320, 240));
    check("another is refused", !wire->setVideoModeDC1394(7) && bool(wire->getVideoModeDC1394(v)) && v == 1);
    check("rates", bool(wire->getFPSMaskDC1394(v)) && v == 255);
    check("rate", bool(wire->setFPSDC1394(5)) && bool(wire->getFPSDC1394(v)) && v == 5 && !wire->setFPSDC1394(8));
    check("speed of the bus", bool(wire->setISOSpeedDC1394(3)) && bool(wire->getISOSpeedDC1394(v)) && v == 3);
    check("codings", bool(wire->getColorCodingMaskDC1394(1, v)) && v == 4 && bool(wire->getColorCodingDC1394(v)) && v == 2);
    check("coding", bool(wire->setColorCodingDC1394(2)) && !wire->setColorCodingDC1394(0));
    check("no window in this mode", !wire->setFormat7WindowDC1394(20, 10, 1, 2));
    check("format 7", bool(wire->setVideoModeDC1394(24)));
    unsigned w = 0, h = 0, a = 0, b = 0, c = 0, d = 0; int x = 0, y = 0;
    check("largest window", bool(wire->getFormat7MaxWindowDC1394(w, h, a, b, c, d)) && w == 640 && h == 480 && a == 1 && b == 1 && c == 1 && d == 1);
    check("window", bool(wire->setFormat7WindowDC1394(20, 10, 300, 200)) && bool(wire->getFormat7WindowDC1394(w, h, x, y)) && w == 20 && h == 10 && x == 300 && y == 200 && becomes(20, 10));
    check("outside", !wire->setFormat7WindowDC1394(20, 10, -1, 0) && !wire->setFormat7WindowDC1394(640, 480, 1, 0));
    bool on = false;
    check("1394b", bool(wire->setOperationModeDC1394(true)) && bool(wire->getOperationModeDC1394(on)) && on);
    check("transmission off", bool(wire->setTransmissionDC1394(false)) && bool(wire->getTransmissionDC1394(on)) && !on);
    check("transmission on", bool(wire->setTransmissionDC1394(true)) && bool(wire->getTransmissionDC1394(on)) && on);
    check("switches", bool(wire->setBroadcastDC1394(true)) && bool(wire->setPowerDC1394(false)) && bool(wire->setPowerDC1394(true)) && bool(wire->setCaptureDC1394(true)));
    check("packets", bool(wire->setBytesPerPacketDC1394(1000)) && bool(wire->getBytesPerPacketDC1394(v)) && v == 1000 && !wire->setBytesPerPacketDC1394(0));
    check("defaults", bool(wire->setDefaultsDC1394()) && bool(wire->getBytesPerPacketDC1394(v)) && v == 4096 && becomes(32, 24));
    check("reset", bool(wire->setResetDC1394()));
    driver.close();
}

int main(int argc, char** argv) {
    if (argc < 4) return 2;
    Network network;
    if (std::string(argv[1]) == "look") {
        look(argv[2], std::string(argv[3]) + "/a", true);
        look(argv[2], std::string(argv[3]) + "/b", false);
        return failures ? 1 : 0;
    }
    if (std::string(argv[1]) == "wire") {
        wired(argv[2], argv[3]);
        return failures ? 1 : 0;
    }
    Drivers::factory().add(new DriverCreatorOf<FakeFrameGrabber>("fakeFrameGrabber", "frameGrabber_nws_yarp", "FakeFrameGrabber"));
    Property a; a.fromString("(device fakeFrameGrabber) (width 32) (height 24) (mode line)");
    a.put("fakeFrameGrabber_rpc_port", std::string(argv[2]) + "/fake/rpc");
    Property b; b.put("device", "frameGrabber_nws_yarp"); b.put("name", argv[2]);
    PolyDriver fake, nws; IWrapper* wrapper = nullptr;
    if (!fake.open(a) || !nws.open(b) || !nws.view(wrapper) || !wrapper->attach(&fake)) return 3;
    Time::delay(atof(argv[3]));
    wrapper->detach(); nws.close(); fake.close();
}
