// The page of the name server: its content, and the choices of the user.

import {
  bytesPerSecond, element, matcher, perSecond, rate, seconds, stateBadge, STATES, watch,
} from "./data.js";
import { placeLink, showDetails } from "./details.js";
import { Graph } from "./graph.js";
import { put, Table } from "./table.js";

const at = (id) => document.getElementById(id);
const chosen = { view: "ports", search: "", states: new Set(), port: null };
let model = null;

const ports = new Table(at("ports"), {
  caption: "Ports",
  key: (port) => port.name,
  select: (port) => select(port.name),
  empty: () => (model.ports.length ? "No port fits the search." : "No ports yet."),
  columns: [
    { title: "Name", width: "34%", value: (port) => port.name, fill: (cell, port) => cell.append(nameButton(port.name)) },
    { title: "State", width: "8rem", value: (port) => Object.keys(STATES).indexOf(port.state), fill: fillState },
    { title: "Place", width: "11.5rem", value: (port) => port.place, fill: (cell, port) => cell.append(placeLink(port)) },
    { title: "Program", width: "22%", value: (port) => port.owner, fill: (cell, port) => put(cell, port.owner) },
    { title: "Carrier", width: "7rem", spare: true, value: (port) => port.carrier, fill: fillCarriers },
    { title: "Type", width: "14%", spare: true, value: (port) => port.type ?? "", fill: (cell, port) => put(cell, port.type ?? "") },
    { title: "Reads", width: "6.8rem", numeric: true, value: (port) => port.inputs.length, fill: (cell, port) => put(cell, flow(port.inputs, port.rateIn)) },
    { title: "Writes", width: "6.8rem", numeric: true, value: (port) => port.outputs.length, fill: (cell, port) => put(cell, flow(port.outputs, port.rateOut)) },
  ],
});

const connections = new Table(at("connections"), {
  caption: "Connections",
  key: (link) => `${link.from} ${link.to}`,
  select: (link) => select(link.from),
  empty: () => (model.connections.length ? "No connection fits the search." : "No port is connected to another."),
  columns: [
    { title: "From", width: "30%", value: (link) => link.from, fill: (cell, link) => cell.append(nameButton(link.from)) },
    { title: "To", width: "30%", value: (link) => link.to, fill: (cell, link) => cell.append(nameButton(link.to)) },
    { title: "Carrier", width: "16%", value: (link) => link.carrier, fill: (cell, link) => put(cell, link.carrier) },
    { title: "Messages", width: "7.5rem", numeric: true, value: (link) => rate(link), fill: (cell, link) => put(cell, perSecond(rate(link))) },
    { title: "Bytes", width: "8rem", numeric: true, value: (link) => link.passed?.bytes_per_second ?? null, fill: (cell, link) => put(cell, bytesPerSecond(link.passed?.bytes_per_second)) },
    { title: "So far", width: "7.5rem", numeric: true, spare: true, value: (link) => link.passed?.messages ?? null, fill: (cell, link) => put(cell, link.passed?.messages.toLocaleString("en") ?? "") },
    { title: "Dropped", width: "7rem", numeric: true, value: dropped, fill: fillDropped },
    { title: "Newest", width: "7rem", numeric: true, spare: true, value: (link) => link.age, fill: (cell, link) => put(cell, seconds(link.age)) },
  ],
});

const graph = new Graph(at("graph"), { select });

function nameButton(name) {
  const button = element("button", "name", name);
  button.type = "button";
  button.title = name;
  button.addEventListener("click", (event) => {
    event.stopPropagation();
    select(name);
  });
  return button;
}

function fillState(cell, port) {
  const badge = stateBadge(port.state);
  if (port.reason) badge.title = port.reason;
  cell.append(badge);
}

function fillCarriers(cell, port) {
  const others = port.accepts.filter((name) => name !== port.carrier);
  cell.append(port.carrier);
  if (others.length) cell.append(element("span", "quiet", ` +${others.length}`));
  cell.title = [port.carrier, ...others].join(" ");
}

function flow(links, speed) {
  if (!links.length) return "";
  return speed === null ? String(links.length) : `${links.length} · ${perSecond(speed)}`;
}

function dropped(link) {
  if (!link.passed) return null;
  return (link.sent?.dropped ?? 0) + (link.received?.dropped ?? 0);
}

function fillDropped(cell, link) {
  const count = dropped(link);
  put(cell, count === null ? "" : count.toLocaleString("en"));
  cell.classList.toggle("bad", count > 0);
}

function select(name) {
  chosen.port = name;
  ports.mark(name);
  connections.mark(null);
  graph.mark(name);
  renderDetails();
  graph.resize(); // at once: the element under the pointer must not move away
  remember();
}

function renderDetails() {
  const place = at("details");
  place.hidden = chosen.port === null;
  // The user may be copying from it.
  const copying = !getSelection().isCollapsed && place.contains(getSelection().anchorNode);
  if (chosen.port === null || !model || (copying && place.dataset.port === chosen.port)) return;
  const controls = () => [...place.querySelectorAll("button, a")];
  const focused = place.dataset.port === chosen.port ? controls().indexOf(document.activeElement) : -1;
  place.dataset.port = chosen.port;
  showDetails(place, chosen.port, model, {
    select,
    close: () => select(null),
    graph: (name) => {
      setView("graph");
      if (!graph.rows?.has(name)) setSearch("");
      graph.reveal(name);
    },
  });
  if (focused >= 0) controls()[focused]?.focus({ preventScroll: true });
}

function setView(view) {
  chosen.view = view;
  at("states").classList.toggle("away", view !== "ports");
  for (const button of at("views").children) {
    button.setAttribute("aria-pressed", button.dataset.view === view);
    at(button.dataset.view).hidden = button.dataset.view !== view;
  }
  render();
  remember();
}

function setSearch(search) {
  chosen.search = search;
  if (at("search").value !== search) at("search").value = search;
  render();
  remember();
}

function renderStates() {
  const counts = {};
  for (const port of model.ports) counts[port.state] = (counts[port.state] ?? 0) + 1;
  const place = at("states");
  for (const state of Object.keys(STATES)) {
    let chip = place.querySelector(`[data-state="${state}"]`);
    const count = counts[state] ?? 0;
    if (!count && !chosen.states.has(state)) {
      chip?.remove();
      continue;
    }
    if (!chip) {
      chip = element("button", "chip");
      chip.type = "button";
      chip.dataset.state = state;
      chip.append(stateBadge(state), element("span", "count"));
      chip.addEventListener("click", () => {
        if (!chosen.states.delete(state)) chosen.states.add(state);
        render();
        remember();
      });
    }
    place.append(chip); // in the order of the states
    chip.querySelector(".count").textContent = count.toLocaleString("en");
    chip.setAttribute("aria-pressed", chosen.states.has(state));
  }
}

function render() {
  if (!model?.server) return;
  const matches = matcher(chosen.search);
  const wanted = (port) => !chosen.states.size || chosen.states.has(port.state);
  const shownPorts = model.ports.filter((port) => wanted(port) && matches(port.text));
  const shownLinks = model.connections.filter((link) => matches(link.text));
  at("ports-count").textContent = counted(shownPorts, model.ports);
  at("connections-count").textContent = counted(shownLinks, model.connections);
  renderStates();
  if (chosen.view === "ports") ports.show(shownPorts);
  if (chosen.view === "connections") connections.show(shownLinks);
  if (chosen.view === "graph") graph.show(model, matches);
}

function counted(shown, all) {
  const total = all.length.toLocaleString("en");
  return shown.length === all.length ? total : `${shown.length.toLocaleString("en")} of ${total}`;
}

// Unchanged text is not announced again.
function say(place, words) {
  if (place.textContent !== words) place.textContent = words;
}

function renderNews() {
  const place = at("news");
  place.classList.toggle("bad", !!model.error);
  if (model.error) {
    const since = model.heard ? `; this is of ${model.heard.toLocaleTimeString()}` : "";
    say(place, `The name server does not answer${since}`);
  } else if (model.interval === null) {
    say(place, "ports are not asked");
  } else {
    say(place, model.rounds ? "live" : "asking the ports …");
  }
  if (!model.server) return;
  at("namespace").textContent = model.server.name;
  at("place").textContent = `${model.server.host}:${model.server.port}`;
  at("version").textContent = `YARP in Rust ${model.server.version}`;
  document.title = `${model.server.name} · YARP network`;
}

// The address contains the view, so that it can be shared.
function remember() {
  const fields = new URLSearchParams();
  if (chosen.view !== "ports") fields.set("view", chosen.view);
  if (chosen.search) fields.set("search", chosen.search);
  if (chosen.states.size) fields.set("states", [...chosen.states].join(" "));
  if (chosen.port !== null) fields.set("port", chosen.port);
  history.replaceState(null, "", `#${fields}`);
}

function recall() {
  const fields = new URLSearchParams(location.hash.slice(1));
  const view = fields.get("view");
  chosen.search = fields.get("search") ?? "";
  at("search").value = chosen.search;
  chosen.states = new Set((fields.get("states") ?? "").split(" ").filter((state) => state in STATES));
  chosen.port = fields.get("port");
  setView(["connections", "graph"].includes(view) ? view : "ports");
  select(chosen.port);
}

at("views").addEventListener("click", (event) => {
  const button = event.target.closest("[data-view]");
  if (button) setView(button.dataset.view);
});
at("search").addEventListener("input", (event) => setSearch(event.target.value));
document.addEventListener("keydown", (event) => {
  if (event.key === "/" && !event.target.matches("input")) {
    event.preventDefault();
    at("search").focus();
  } else if (event.key === "Escape") {
    if (event.target === at("search") && chosen.search) setSearch("");
    else if (chosen.port !== null) select(null);
  }
});
addEventListener("hashchange", recall);

recall();
watch((heard) => {
  model = heard;
  renderNews();
  render();
  renderDetails();
});
