// Sliders, control modes and the emergency stop.

import { element, jointName, plain } from "./panels.js";

const MAX_COMMANDS_PER_SECOND = 15;
// Time after which a slider follows the robot again, once nobody drags it.
const FOLLOW_DELAY_MS = 1500;

export class Controls {
  // `urgent` are commands that wait for no others.
  constructor(at, commands, urgent) {
    this.at = at;
    this.commands = commands;
    this.urgent = urgent;
    this.guided = { busy: false, next: null };
    this.sliders = { move: [], hand: [] };
    this.stopped = false;
    // A finger or a button that goes down is meant; the click follows a tenth of a second later.
    at("stop").addEventListener("pointerdown", ({ button }) => button === 0 && this.stop());
    at("stop").addEventListener("click", ({ detail }) => detail === 0 && this.stop());
    at("release").addEventListener("click", () => this.tell("release"));
    at("halt").addEventListener("click", () => this.tell("halt"));
    at("mode").addEventListener("change", () => this.tell("mode", at("mode").value));
    for (const button of document.querySelectorAll("[data-grasp]")) {
      button.addEventListener("click", () => {
        for (const finger of [0, 1, 2]) this.tell("hand", finger, { number: Number(button.dataset.grasp) });
      });
    }
  }

  enable(config) {
    if (this.sliders.move.length || !config.control) return;
    document.body.classList.add("control");
    this.urgent.keep();
    this.at("controls").hidden = false;
    this.at("emergency").hidden = false;
    config.limits.forEach(([low, high], index) => this.add("move", "sliders", index, jointName(index), low, high));
    if (config.hand) {
      this.at("hand-controls").hidden = false;
      ["finger 1", "finger 2", "finger 3", "spread"].forEach((name, index) => this.add("hand", "hand-sliders", index, name, 0, index < 3 ? 140 : 180));
    }
  }

  add(command, place, index, name, low, high) {
    const label = element("label", "slider");
    const input = element("input");
    Object.assign(input, { type: "range", min: Math.ceil(low * 10) / 10, max: Math.floor(high * 10) / 10, step: 0.1 });
    input.id = `${command}-${index}`;
    input.setAttribute("aria-label", `${name}, degrees`);
    const output = element("output");
    label.append(element("span", "", name), input, output);
    this.at(place).append(label);
    const slider = { input, output, touched: -Infinity, busy: false, next: null };
    this.sliders[command].push(slider);
    input.addEventListener("input", () => {
      slider.touched = performance.now();
      output.textContent = `${Number(input.value).toFixed(1)}°`;
      slider.next = [command, index, { number: Number(input.value) }];
      this.pump(slider);
    });
  }

  // Guides the tool to a place: m, in the frame of the base.
  guide(place) {
    this.guided.next = ["guide", ...place.map((number) => ({ number }))];
    this.pump(this.guided);
  }

  // Sends the newest command of a slider or of the handle, one at a time.
  async pump(source) {
    if (source.busy) return;
    source.busy = true;
    while (source.next !== null) {
      const command = source.next;
      source.next = null;
      await this.tell(...command);
      await new Promise((later) => setTimeout(later, 1000 / MAX_COMMANDS_PER_SECOND));
    }
    source.busy = false;
  }

  async stop() {
    for (const source of [this.guided, ...this.sliders.move, ...this.sliders.hand]) source.next = null;
    this.show(await this.urgent.send("stop"));
  }

  async tell(...items) {
    return this.show(await this.commands.send(...items));
  }

  show([verdict, reason]) {
    const place = this.at("verdict");
    place.textContent = verdict === "ok" ? "" : reason;
    place.classList.toggle("bad", verdict !== "ok");
    return verdict === "ok";
  }

  // Sliders show where the robot is, unless somebody drags them.
  follow(state) {
    const now = performance.now();
    for (const [command, board] of [["move", state.arm], ["hand", state.hand]]) {
      this.sliders[command].forEach((slider, index) => {
        const position = board?.p[index];
        // An arm without a wrist has fewer joints.
        if (board) slider.input.parentElement.hidden = position === undefined;
        if (position === undefined || now - slider.touched < FOLLOW_DELAY_MS) return;
        const text = `${plain(position, 1)}°`;
        if (slider.output.textContent === text) return;
        slider.input.value = position;
        slider.output.textContent = text;
      });
    }
    const words = { position: "pos", velocity: "vel", torque: "torq", idle: "idl" };
    const mode = words[state.arm?.m?.[0]];
    if (mode && document.activeElement !== this.at("mode")) this.at("mode").value = mode;
  }

  setStopped(stopped) {
    if (stopped === this.stopped) return;
    this.stopped = stopped;
    this.at("release").hidden = !stopped;
    for (const control of document.querySelectorAll("#controls input, #controls select, #controls button")) control.disabled = stopped;
  }
}
