// Tables and log. Texts of the network are always text, never markup.

import { COLOURS } from "./plots.js";

export function element(tag, className = "", text = "") {
  const made = document.createElement(tag);
  if (className) made.className = className;
  if (text !== "") made.textContent = text;
  return made;
}

const NAMES = ["base yaw", "shoulder pitch", "shoulder yaw", "elbow", "wrist yaw", "wrist pitch", "wrist roll"];
export const jointName = (index) => NAMES[index] ?? `joint ${index}`;

// Sets a text if it is another.
export function setText(place, text) {
  if (place.textContent !== text) place.textContent = text;
}

function fill(table, titles, rows) {
  const head = element("tr");
  for (const { title, numeric } of titles) head.append(element("th", numeric ? "number" : "", title));
  table.replaceChildren(head, ...rows);
}

function row(cells, titles) {
  const made = element("tr");
  cells.forEach((cell, index) => {
    const place = element("td", titles[index].numeric ? "number" : "");
    place.append(cell);
    made.append(place);
  });
  return made;
}

const JOINT_TITLES = [{ title: "Joint" }, { title: "Degrees", numeric: true }, { title: "°/s", numeric: true }, { title: "N m", numeric: true }, { title: "Mode" }];

// A number without a minus in front of zeros.
export const plain = (value, digits) => value.toFixed(digits).replace(/^-(?=0\.?0*$)/, "");

export function showJoints(table, arm) {
  if (table.rows.length !== arm.p.length + 1) {
    const rows = arm.p.map((_, index) => {
      const name = element("span");
      const swatch = element("span", "swatch");
      swatch.style.background = COLOURS[index % COLOURS.length];
      name.append(swatch, jointName(index));
      return row([name, "", "", "", ""], JOINT_TITLES);
    });
    fill(table, JOINT_TITLES, rows);
  }
  arm.p.forEach((position, index) => {
    const texts = [plain(position, 1), arm.v ? plain(arm.v[index], 1) : "–", arm.t ? plain(arm.t[index], 2) : "–", arm.m?.[index] ?? "–"];
    texts.forEach((text, cell) => setText(table.rows[index + 1].cells[cell + 1], text));
  });
}

const NETWORK_TITLES = [{ title: "From" }, { title: "To" }, { title: "Carrier" }, { title: "Messages", numeric: true }, { title: "Bytes", numeric: true }, { title: "Dropped", numeric: true }];

export function showNetwork(table, count, network, sources) {
  if (!network?.connections) {
    // Without a survey of the name server the view tells what it knows itself.
    const titles = [{ title: "Source" }, { title: "Messages", numeric: true }];
    fill(table, titles, sources.map((source) => row([state(source), `${source.rate.toFixed(0)}/s`], titles)));
    count.textContent = network?.error ?? "";
    return;
  }
  const missing = sources.filter((source) => !source.connected);
  count.textContent = `${network.count} connections` + (missing.length ? ` · waiting for ${missing.map((source) => source.port).join(", ")}` : "");
  const rows = network.connections.map((link) => {
    const passed = link.sent ?? link.received;
    const lost = (link.sent?.dropped ?? 0) + (link.received?.dropped ?? 0);
    const dropped = element("span", lost ? "bad" : "", passed ? lost.toLocaleString("en") : "");
    return row([link.from, link.to, link.carrier ?? "", rate(passed?.messages_per_second), bytes(passed?.bytes_per_second), dropped], NETWORK_TITLES);
  });
  fill(table, NETWORK_TITLES, rows);
}

function state(source) {
  return element("span", `dot${source.connected ? "" : " off"}`, source.port);
}

const rate = (value) => (value === null || value === undefined ? "" : `${value < 10 ? value.toFixed(1) : Math.round(value)}/s`);

function bytes(value) {
  if (value === null || value === undefined) return "";
  const units = ["B", "kB", "MB", "GB"];
  let unit = 0;
  while (value >= 1000 && unit < units.length - 1) {
    value /= 1000;
    unit += 1;
  }
  return `${value < 10 ? value.toFixed(1) : Math.round(value)} ${units[unit]}/s`;
}

// The last part of a name such as `yarp.os.Port`; all of it under the pointer.
function origin(source) {
  const made = element("span", "source", source.slice(source.lastIndexOf(".") + 1));
  made.title = source;
  return made;
}

export class LogPanel {
  next = 0;

  constructor(section) {
    this.list = section.querySelector("ol");
  }

  show({ first, lines }) {
    // A view that was restarted counts from the beginning.
    if (first + lines.length < this.next) {
      this.next = 0;
      this.list.replaceChildren();
    }
    const fresh = lines.slice(Math.max(0, this.next - first));
    if (!fresh.length) return;
    const isAtEnd = this.list.scrollHeight - this.list.scrollTop - this.list.clientHeight < 30;
    for (const { time, level, source, text } of fresh) {
      const line = element("li");
      line.append(element("time", "", new Date(time * 1000).toLocaleTimeString("en-GB")), origin(source), element("span", level, text));
      this.list.append(line);
    }
    while (this.list.children.length > 200) this.list.firstChild.remove();
    this.next = first + lines.length;
    if (isAtEnd) this.list.scrollTop = this.list.scrollHeight;
  }
}
