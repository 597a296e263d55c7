// The graph of the network: programs as boxes with their ports, connections as lines.

import { element, perSecond, rate, seconds, stateBadge, STATES } from "./data.js";
import { layout } from "./layout.js";

const SVG = "http://www.w3.org/2000/svg";
const ROW = 24;
const HEAD = 28;
const LETTER = 7.1;
const MAX_NAME_CHARS = 38; // shown characters of a name
const MAX_PORTS = 1500; // a search shows the others
const MARGIN_X = 60;
const MARGIN_TOP = 64; // for controls above the graph
const MARGIN_BOTTOM = 44;
const MAX_READABLE_SCALE = 1.9; // beyond this scale names are unreadable
const MAX_LABELLED_LINKS = 24; // up to this number all links are labelled

export class Graph {
  // actions: { select(name or null) }
  constructor(place, actions) {
    this.actions = actions;
    this.selected = null;
    this.drawn = "";
    this.view = null; // { x, y, width, height } of the visible part; null shows all
    this.grouped = true;

    this.canvas = make("svg", { class: "canvas", role: "group", "aria-label": "Graph of the network" });
    this.marks();
    this.scene = make("g");
    this.canvas.append(this.scene);
    this.note = element("p", "empty");
    place.append(this.tools(), this.canvas, this.note, legend());
    this.listen();
    new ResizeObserver(() => this.resize()).observe(this.canvas);
  }

  tools() {
    const tools = element("div", "over");
    const button = (text, label, act) => {
      const made = element("button", "round", text);
      made.type = "button";
      made.title = label;
      made.setAttribute("aria-label", label);
      made.addEventListener("click", act);
      tools.append(made);
    };
    button("+", "Closer", () => this.zoom(1 / 1.4));
    button("−", "Farther", () => this.zoom(1.4));
    button("⤢", "Show all", () => this.all());
    const label = element("label", "switch");
    const box = element("input");
    box.type = "checkbox";
    box.checked = true;
    box.addEventListener("change", () => {
      this.grouped = box.checked;
      this.all();
    });
    label.append(box, "ports of a program together");
    tools.append(label);
    return tools;
  }

  marks() {
    const defs = make("defs");
    for (const kind of ["plain", "strong"]) {
      const mark = make("marker", {
        id: `arrow-${kind}`, class: `arrow ${kind}`, viewBox: "0 0 8 8", refX: 7, refY: 4,
        markerWidth: 8, markerHeight: 8, markerUnits: "userSpaceOnUse", orient: "auto",
      });
      mark.append(make("path", { d: "M0 0.5L8 4L0 7.5z" }));
      defs.append(mark);
    }
    this.canvas.append(defs);
  }

  // matches(port or link text) returns true for search results.
  show(model, matches) {
    this.model = model;
    this.matches = matches;
    if (!model || !this.canvas.clientWidth) return;
    const { ports, links, left } = this.choose();
    const drawn = JSON.stringify([
      this.grouped, links.map((link) => [link.from, link.to]),
      ports.map((name) => this.boxOf(name)),
    ]);
    if (drawn !== this.drawn) {
      this.drawn = drawn;
      this.build(ports, links);
      this.frame();
    }
    this.refresh(links);
    this.note.textContent = links.length
      ? left ? `${left} more ports are not shown: search for some.` : ""
      : model.connections.length ? "Nothing connected fits the search." : "No port is connected to another.";
    this.note.classList.toggle("corner", links.length > 0);
  }

  // Connected ports that fit the search, with their neighbours.
  choose() {
    const { byName, connections } = this.model;
    const wanted = (name) => this.matches(byName.get(name)?.text ?? name.toLowerCase());
    const seen = new Set();
    const links = [];
    let left = 0;
    for (const link of connections) {
      if (!wanted(link.from) && !wanted(link.to)) continue;
      const fresh = [link.from, link.to].filter((name) => !seen.has(name));
      if (seen.size + fresh.length > MAX_PORTS) {
        left += fresh.length;
        continue;
      }
      fresh.forEach((name) => seen.add(name));
      links.push(link);
    }
    return { ports: [...seen].sort(), links, left };
  }

  // Box of a port: that of its program, if known.
  boxOf(name) {
    const process = this.model.byName.get(name)?.process;
    if (!this.grouped || !process?.pid) return name;
    return `${process.pid}@${process.host ?? this.model.byName.get(name).host}`;
  }

  build(ports, links) {
    const boxes = new Map();
    for (const name of ports) {
      const id = this.boxOf(name);
      if (!boxes.has(id)) boxes.set(id, { id, ports: [], anchors: new Map() });
      boxes.get(id).ports.push(name);
    }
    for (const box of boxes.values()) this.measure(box);
    const lines = links.map((link) => ({
      from: this.boxOf(link.from), to: this.boxOf(link.to),
      fromPort: link.from, toPort: link.to,
    }));
    const { clientWidth, clientHeight } = this.canvas;
    const room = {
      width: Math.max(200, clientWidth - MARGIN_X), height: Math.max(200, clientHeight - MARGIN_TOP - MARGIN_BOTTOM),
    };
    this.size = layout([...boxes.values()], lines, room);
    this.rows = new Map();
    this.lines = new Map();
    const drawnLines = make("g", { class: "lines" });
    const drawnBoxes = make("g", { class: "boxes" });
    lines.forEach((line) => drawnLines.append(this.line(line, boxes)));
    for (const box of boxes.values()) drawnBoxes.append(this.box(box));
    this.scene.replaceChildren(drawnLines, drawnBoxes);
    this.neighbours = new Map(ports.map((name) => [name, new Set([name])]));
    for (const link of links) {
      this.neighbours.get(link.from).add(link.to);
      this.neighbours.get(link.to).add(link.from);
    }
  }

  measure(box) {
    const owner = this.model.byName.get(box.ports[0])?.owner ?? "";
    box.title = box.ports.length > 1 ? owner : "";
    const head = box.title ? HEAD : 0;
    const longest = Math.max(...[box.title, ...box.ports].map((text) => shorten(text).length));
    box.width = Math.round(longest * LETTER) + 40;
    box.height = head + box.ports.length * ROW + (head ? 6 : 4);
    box.ports.forEach((name, index) => box.anchors.set(name, head + 2 + (index + 0.5) * ROW));
  }

  box(box) {
    const kind = box.title ? "program" : "alone";
    const group = make("g", { class: kind, transform: `translate(${box.x} ${box.y})` });
    group.append(make("rect", { class: "box", width: box.width, height: box.height, rx: 8 }));
    if (box.title) {
      // Readable at a small scale.
      const words = shorten(box.title.replace(/ \(.*/, ""));
      const size = Math.min(40, box.height * 0.5, (box.width - 44) / (words.length * 0.62));
      const middle = { x: box.width / 2 + 8, y: box.height / 2 + size * 0.35 };
      group.append(text(words, { class: "big", ...middle, "font-size": size }));
      group.append(text(shorten(box.title), { class: "title", x: 12, y: 19 }));
      group.append(make("line", { class: "rule", x1: 0, x2: box.width, y1: HEAD - 2, y2: HEAD - 2 }));
    }
    for (const name of box.ports) {
      const y = box.anchors.get(name) - ROW / 2;
      const row = make("g", {
        class: "port", transform: `translate(0 ${y})`, tabindex: 0, role: "button", "data-name": name,
      });
      row.append(title(name));
      row.append(make("rect", { class: "hit", x: 2, width: box.width - 4, height: ROW, rx: 6 }));
      row.append(text("", { class: "sign", x: 12, y: 16 }));
      row.append(text(shorten(name), { class: "name", x: 28, y: 16.5 }));
      this.rows.set(name, row);
      group.append(row);
    }
    return group;
  }

  line(line, boxes) {
    const from = boxes.get(line.from);
    const to = boxes.get(line.to);
    // From the side that faces the reader to the side that faces the writer.
    const back = to.x < from.x;
    const start = { x: from.x + (back ? 0 : from.width), y: from.y + from.anchors.get(line.fromPort) };
    const end = {
      x: from === to || back ? to.x + to.width + 2 : to.x - 2,
      y: to.y + to.anchors.get(line.toPort),
    };
    const path = curve(start, line.points, end, from === to);
    const group = make("g", { class: "link", "data-from": line.fromPort, "data-to": line.toPort });
    group.append(make("path", { class: "wide", d: path }));
    group.append(make("path", { class: "line", d: path }));
    group.append(title(""), text("", { class: "label" }));
    this.lines.set(key(line.fromPort, line.toPort), group);
    return group;
  }

  // Updates that need no new layout: states, rates, highlights.
  refresh(links) {
    for (const [name, row] of this.rows) {
      const state = this.model.byName.get(name)?.state ?? "absent";
      row.classList.remove(...Object.keys(STATES));
      row.classList.add(state);
      row.querySelector(".sign").textContent = STATES[state].sign;
      row.setAttribute("aria-label", `${name}, ${STATES[state].words}`);
    }
    this.canvas.classList.toggle("few", links.length <= MAX_LABELLED_LINKS);
    for (const link of links) {
      const group = this.lines.get(key(link.from, link.to));
      const speed = rate(link);
      group.classList.toggle("busy", speed > 0);
      const width = speed > 0 ? Math.min(4, 1.4 + Math.log10(1 + speed)) : 1.2;
      group.querySelector(".line").style.strokeWidth = `${width}px`;
      const words = [link.carrier, perSecond(speed)].filter(Boolean).join(" · ");
      group.querySelector(".label").textContent = words;
      const age = link.age === null ? "" : `, newest ${seconds(link.age)} old`;
      group.querySelector("title").textContent = `${link.from} → ${link.to}\n${words}${age}`;
    }
    this.mark(this.selected);
  }

  mark(selected) {
    this.selected = selected;
    const shown = this.hovered ?? selected;
    const near = this.neighbours?.get(shown);
    this.canvas.classList.toggle("marked", !!near);
    for (const [name, row] of this.rows ?? []) {
      row.classList.toggle("near", !!near?.has(name));
      row.classList.toggle("chosen", name === selected);
      row.setAttribute("aria-pressed", name === selected);
    }
    for (const group of this.lines?.values() ?? []) {
      const { from, to } = group.dataset;
      group.classList.toggle("near", from === shown || to === shown);
      // Lines of one port part at their other ends.
      const at = from === shown ? 0.7 : to === shown ? 0.3 : 0.6;
      if (group.dataset.at !== String(at)) {
        group.dataset.at = at;
        const path = group.querySelector(".line");
        const { x, y } = path.getPointAtLength(path.getTotalLength() * at);
        const label = group.querySelector(".label");
        label.setAttribute("x", x);
        label.setAttribute("y", y - 5);
      }
    }
  }

  listen() {
    const nameAt = (event) => event.target.closest?.(".port")?.dataset.name ?? null;
    let drag = null;
    this.canvas.addEventListener("pointerdown", (event) => {
      if (event.button !== 0 || !this.view) return;
      drag = { x: event.clientX, y: event.clientY, moved: false, name: nameAt(event) };
    });
    this.canvas.addEventListener("pointermove", (event) => {
      if (!drag) return;
      const [dx, dy] = [event.clientX - drag.x, event.clientY - drag.y];
      if (!drag.moved && Math.hypot(dx, dy) < 4) return;
      if (!drag.moved) this.canvas.setPointerCapture(event.pointerId);
      const scale = this.view.width / this.canvas.clientWidth;
      this.view.x -= dx * scale;
      this.view.y -= dy * scale;
      this.touched = true;
      Object.assign(drag, { x: event.clientX, y: event.clientY, moved: true });
      this.frame();
    });
    this.canvas.addEventListener("pointerup", () => {
      if (drag && !drag.moved) {
        this.touched ||= drag.name !== null; // a clicked port keeps its place
        this.hovered = null;
        this.actions.select(drag.name);
      }
      drag = null;
    });
    this.canvas.addEventListener("pointercancel", () => {
      drag = null;
    });
    this.canvas.addEventListener("pointerover", (event) => this.hover(nameAt(event)));
    this.canvas.addEventListener("pointerleave", () => this.hover(null));
    this.canvas.addEventListener("keydown", (event) => {
      const name = nameAt(event);
      if (name && (event.key === "Enter" || event.key === " ")) {
        event.preventDefault();
        this.actions.select(name);
      }
    });
    this.canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      const box = this.canvas.getBoundingClientRect();
      const at = { x: (event.clientX - box.left) / box.width, y: (event.clientY - box.top) / box.height };
      this.zoom(Math.exp(event.deltaY * 0.0015), at);
    }, { passive: false });
  }

  hover(name) {
    if (this.hovered === name) return;
    this.hovered = name;
    this.mark(this.selected);
  }

  zoom(factor, at = { x: 0.5, y: 0.5 }) {
    if (!this.view) return;
    const width = Math.max(200, Math.min(40000, this.view.width * factor));
    const change = width / this.view.width;
    this.view.x += this.view.width * at.x * (1 - change);
    this.view.y += this.view.height * at.y * (1 - change);
    this.view.width = width;
    this.touched = true;
    this.frame();
  }

  // Shows everything, with a layout for the present size.
  all() {
    this.touched = false;
    this.drawn = "";
    this.show(this.model, this.matches);
  }

  // Handles a new size; the scale is kept if the user chose it.
  resize() {
    const { clientWidth } = this.canvas;
    if (!clientWidth) return;
    if (this.touched && this.view && this.width) this.view.width *= clientWidth / this.width;
    this.width = clientWidth;
    this.frame();
    if (this.touched) this.sight(this.selected);
  }

  // Scrolls as little as possible to show a port.
  sight(name) {
    const row = this.rows?.get(name);
    if (!row || !this.view) return;
    const box = row.getBoundingClientRect();
    const canvas = this.canvas.getBoundingClientRect();
    const scale = this.view.width / canvas.width;
    const beyond = (low, high, start, end) => Math.max(0, high - end + 24) || Math.min(0, low - start - 24);
    this.view.x += beyond(box.left, box.right, canvas.left, canvas.right) * scale;
    this.view.y += beyond(box.top, box.bottom, canvas.top, canvas.bottom) * scale;
    this.frame();
  }

  // Centres a port at a readable scale.
  reveal(name) {
    const row = this.rows?.get(name);
    if (!row || !this.view) return;
    const box = row.getBoundingClientRect();
    const canvas = this.canvas.getBoundingClientRect();
    const scale = this.view.width / canvas.width;
    const x = this.view.x + (box.left + box.width / 2 - canvas.left) * scale;
    const y = this.view.y + (box.top + box.height / 2 - canvas.top) * scale;
    this.view.width = Math.min(this.view.width, canvas.width * 1.2);
    this.view.x = x - this.view.width / 2;
    this.view.y = y - (this.view.width * canvas.height) / canvas.width / 2;
    this.touched = true;
    this.frame();
  }

  frame() {
    const { clientWidth, clientHeight } = this.canvas;
    if (!clientWidth || !clientHeight || !this.size) return;
    if (!this.touched) {
      const scale = Math.max(
        1 / 1.25,
        this.size.width / Math.max(1, clientWidth - MARGIN_X),
        this.size.height / Math.max(1, clientHeight - MARGIN_TOP - MARGIN_BOTTOM),
      );
      const [width, height] = [clientWidth * scale, clientHeight * scale];
      const shift = ((MARGIN_TOP - MARGIN_BOTTOM) / 2) * scale;
      this.view = {
        x: (this.size.width - width) / 2, y: (this.size.height - height) / 2 - shift, width, height,
      };
    }
    const { view } = this;
    view.height = (view.width * clientHeight) / clientWidth;
    this.canvas.classList.toggle("far", view.width / clientWidth > MAX_READABLE_SCALE);
    this.canvas.setAttribute("viewBox", `${view.x} ${view.y} ${view.width} ${view.height}`);
  }
}

const key = (from, to) => `${from}\n${to}`;

// Path from the side of a box to that of another, through the bends.
function curve(start, points, end, loop) {
  const { x, y } = start;
  if (loop) return `M${x} ${y}C${x + 70} ${y} ${end.x + 70} ${end.y} ${end.x} ${end.y}`;
  const back = end.x < x;
  const stops = [start];
  for (const point of points) {
    const [left, right] = [{ x: point.x, y: point.y }, { x: point.x + point.width, y: point.y }];
    stops.push(...(back ? [right, left] : [left, right]));
  }
  stops.push(end);
  let path = `M${x} ${y}`;
  for (let index = 1; index < stops.length; index += 1) {
    const [a, b] = [stops[index - 1], stops[index]];
    const reach = (b.x - a.x) / 2;
    path += `C${a.x + reach} ${a.y} ${b.x - reach} ${b.y} ${b.x} ${b.y}`;
  }
  return path;
}

// Shortens a long name in the middle.
function shorten(name) {
  if (name.length <= MAX_NAME_CHARS) return name;
  return `${name.slice(0, MAX_NAME_CHARS / 2 - 2)}…${name.slice(1 - MAX_NAME_CHARS / 2)}`;
}

function make(tag, attributes = {}) {
  const made = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  return made;
}

function text(content, attributes) {
  const made = make("text", attributes);
  made.textContent = content;
  return made;
}

function title(content) {
  const made = make("title");
  made.textContent = content;
  return made;
}

function legend() {
  const made = element("p", "legend quiet");
  for (const state of Object.keys(STATES)) made.append(stateBadge(state));
  return made;
}
