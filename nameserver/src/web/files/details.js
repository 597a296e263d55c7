// Panel with the details of one port.

import { bytesPerSecond, element, perSecond, rate, stateBadge } from "./data.js";

// actions: { select(name), close(), graph(name) }
export function showDetails(place, name, model, actions) {
  const port = model.byName.get(name);
  const scrolled = place.scrollTop;
  const head = element("div", "head");
  const close = button("✕", () => actions.close());
  close.className = "round";
  close.setAttribute("aria-label", "Close");
  head.append(element("h2", "", name), close);
  place.replaceChildren(head);
  if (!port) {
    place.append(element("p", "", "The name server does not know this name."));
    place.append(...lists(name, model, actions));
    return;
  }
  const line = element("p");
  line.append(stateBadge(port.state));
  place.append(line);
  if (port.reason) place.append(element("p", "note", port.reason));
  place.append(facts(port), ...lists(name, model, actions));
  place.scrollTop = scrolled;
}

function facts(port) {
  const list = element("dl");
  const add = (title, content) => {
    if (!content) return;
    const value = element("dd");
    value.append(content);
    list.append(element("dt", "", title), value);
  };
  add("place", placeLink(port));
  add("program", port.owner);
  add("arguments", port.process?.arguments);
  add("machine", port.process?.host);
  add("type", port.type);
  add("carriers", carriers(port));
  return list;
}

// Link to the page of a port; groups and topics have none.
export function placeLink(port) {
  if (port.carrier === "mcast" || port.carrier === "topic") return element("span", "", port.place);
  const link = element("a", "", port.place);
  const host = port.host.includes(":") && !port.host.startsWith("[") ? `[${port.host}]` : port.host;
  link.href = `http://${host}:${port.port}/`;
  link.rel = "noreferrer";
  link.target = "_blank";
  link.title = "The page of this port";
  return link;
}

function carriers(port) {
  const names = [...new Set([port.carrier, ...port.accepts])];
  const chips = element("span", "chips");
  for (const name of names) {
    chips.append(element("span", name === port.carrier ? "chip first" : "chip", name));
  }
  return chips;
}

function lists(name, model, actions) {
  const port = model.byName.get(name);
  const reads = port?.inputs ?? model.connections.filter((link) => link.to === name);
  const writes = port?.outputs ?? model.connections.filter((link) => link.from === name);
  const made = [
    ...linkList("Reads from", reads, "from", model, actions),
    ...linkList("Writes to", writes, "to", model, actions),
  ];
  if (reads.length + writes.length > 0) {
    made.push(button("Show in the graph", () => actions.graph(name)));
  }
  return made;
}

const MAX_CONNECTIONS = 200; // connections shown per direction

function linkList(title, links, end, model, actions) {
  if (!links.length) return [];
  const list = element("ul", "links");
  for (const link of links.slice(0, MAX_CONNECTIONS)) {
    const item = element("li");
    const peer = model.byName.get(link[end]);
    const name = button(link[end], () => actions.select(link[end]));
    name.className = "name";
    const passed = [
      link.carrier, perSecond(rate(link)), bytesPerSecond(link.passed?.bytes_per_second),
      link.passed?.dropped ? `${link.passed.dropped} dropped` : "",
    ].filter(Boolean).join(" · ");
    const badge = stateBadge(peer?.state ?? "absent");
    badge.lastChild.remove();
    item.append(badge, name, element("span", "quiet", passed));
    list.append(item);
  }
  const more = links.length > MAX_CONNECTIONS ? [element("p", "quiet", `and ${links.length - MAX_CONNECTIONS} more`)] : [];
  return [element("h3", "", `${title} (${links.length})`), list, ...more];
}

function button(text, act) {
  const made = element("button", "", text);
  made.type = "button";
  made.addEventListener("click", act);
  return made;
}
