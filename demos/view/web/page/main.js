// The live view: takes the stream apart and hands each part to its panel.

import { CameraPanel } from "./camera.js";
import { Commands, watch } from "./connection.js";
import { Controls } from "./controls.js";
import { element, LogPanel, setText, showJoints, showNetwork } from "./panels.js";
import { Plot } from "./plots.js";

const TABLE_INTERVAL_MS = 150;
const PLOT_INTERVAL_MS = 100;
// Age of the state of the arm above which it is reported as lost, in seconds.
const MAX_STATE_AGE = 1;

const at = (id) => document.getElementById(id);
const positions = new Plot(at("positions"));
const torques = new Plot(at("torques"));
const camera = new CameraPanel(at);
const controls = new Controls(at, new Commands(), new Commands());
const log = new LogPanel(at("log"));
let scene = null;
let config = null;
let stateAt = -Infinity;
const stats = { states: 0, frames: 0, since: performance.now(), rate: 0, fps: 0, connected: false };
// For tests and the curious.
globalThis.view = { stats, get scene() { return scene; }, state: null, status: null };

function takeState(state) {
  stats.states += 1;
  stateAt = performance.now();
  globalThis.view.state = state;
  if (state.arm) {
    positions.add(state.time, state.arm.p);
    torques.add(state.time, state.arm.t);
  }
  scene?.setState(state);
}

function takeStatus(status) {
  globalThis.view.status = status;
  if (JSON.stringify(status.config) !== JSON.stringify(config)) {
    config = status.config;
    configure();
  }
  controls.setStopped(status.stopped);
  scene?.handle.setEnabled(config.control && !status.stopped);
  const banner = at("banner");
  banner.hidden = !status.stopped;
  banner.textContent = status.stopped ? "Emergency stop: arm and hand are halted, and the arm refuses every command until the stop is released." : "";
  camera.setDetections(status.detections);
  scene?.setPlan(status.plan);
  scene?.setDetections(status.detections);
  showPlan(status.plan);
  showNetwork(at("network").querySelector("table"), at("network-count"), status.network, status.sources);
  log.show(status.log);
}

function configure() {
  at("arm").textContent = config.arm;
  document.title = `${config.arm} · live view`;
  if (config.server) {
    at("server").href = config.server;
    at("server").hidden = false;
  }
  document.body.classList.toggle("no-camera", !config.camera);
  controls.enable(config);
  if (scene || !config.scene) {
    if (!config.scene) explainNoScene("This program was built without the 3D view: its packages were not installed. Run “make setup” (or “npm ci” in demos/view/web) and build again.");
    return;
  }
  import("/view/scene.js").then(({ Scene }) => {
    scene = new Scene(at("scene"), { urdf: "/robot/wam.urdf", readout: showTool, failed: explainNoScene, guide: (place) => controls.guide(place), full: location.hash === "#full" });
    scene.handle.setEnabled(config.control && !globalThis.view.status.stopped);
    if (globalThis.view.table) scene.setTable(globalThis.view.table);
    if (globalThis.view.state) scene.setState(globalThis.view.state);
  }).catch((error) => explainNoScene(`3D cannot be shown: ${error.message}`));
}

function explainNoScene(text) {
  at("no-scene").textContent = text;
  at("no-scene").hidden = false;
  at("scene").hidden = true;
  at("views").hidden = true;
}

function showPlan(plan) {
  const show = (id, value) => {
    at(id).hidden = !value;
    if (value && at(id).textContent !== value) at(id).textContent = value;
  };
  show("phase", plan?.phase);
  show("step", plan?.text);
  const progress = at("progress");
  progress.hidden = !plan?.progress;
  if (plan?.progress) [progress.value, progress.max] = plan.progress;
}

function showTool(...values) {
  const place = at("tool");
  if (!place.children.length) {
    for (const name of ["x", "y", "z"]) place.append(element("dt", "", name), element("dd"));
  }
  const cells = place.querySelectorAll("dd");
  values.forEach((value, index) => setText(cells[index], `${(value * 1000).toFixed(0)} mm`));
}

function showNews() {
  const place = at("news");
  const age = (performance.now() - stateAt) / 1000;
  const isFresh = stats.connected && age < MAX_STATE_AGE;
  place.className = isFresh ? "live" : stats.connected ? "" : "lost";
  const viewers = globalThis.view.status?.viewers ?? 1;
  const skipped = globalThis.view.status?.skipped ?? 0;
  const others = (viewers > 1 ? ` · ${viewers} viewers` : "") + (skipped ? ` · ${skipped.toLocaleString("en")} skipped` : "");
  place.textContent = !stats.connected ? "no connection" : isFresh ? `live · ${stats.rate.toFixed(0)} states/s${others}` : `waiting for ${config?.arm ?? "the robot"}`;
  at("rates").textContent = scene ? `${stats.fps.toFixed(0)} frames/s` : "";
}

setInterval(() => {
  const now = performance.now();
  const seconds = (now - stats.since) / 1000;
  stats.rate = stats.states / seconds;
  stats.fps = stats.frames / seconds;
  Object.assign(stats, { states: 0, frames: 0, since: now });
  showNews();
}, 1000);

let tableAt = 0, plotAt = 0, plotNext = false;
function frame(now) {
  requestAnimationFrame(frame);
  if (scene?.draw(now)) stats.frames += 1;
  if (now - plotAt > PLOT_INTERVAL_MS / 2) {
    plotAt = now;
    // One of them per frame: together they would delay it.
    (plotNext = !plotNext) ? positions.draw() : torques.draw();
  }
  const arm = globalThis.view.state?.arm;
  if (arm && now - tableAt > TABLE_INTERVAL_MS) {
    tableAt = now;
    showJoints(at("joints").querySelector("table"), arm);
    controls.follow(globalThis.view.state);
  }
}
requestAnimationFrame(frame);

at("views").addEventListener("click", ({ target }) => {
  const view = target.dataset?.view;
  if (!view || !scene) return;
  if (target.hasAttribute("aria-pressed")) {
    const pressed = target.getAttribute("aria-pressed") !== "true";
    target.setAttribute("aria-pressed", pressed);
    scene.setOption(view, pressed);
  } else {
    scene.look(view);
  }
});

watch((message, blob) => {
  if (message.state) takeState(message.state);
  if (message.status) takeStatus(message.status);
  if (message.scene) {
    globalThis.view.table = message.scene;
    scene?.setTable(message.scene);
  }
  if (message.image) camera.show(message.image, blob);
}, (word) => {
  stats.connected = word === "open";
  showNews();
});
