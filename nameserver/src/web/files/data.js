// Fetches the data of the name server periodically while the page is visible.

const FIRST_FETCH_DELAY_MS = 300; // until the ports have been queried for the first time
const MIN_FETCH_INTERVAL_MS = 1000;
const FETCH_TIMEOUT_MS = 15000;

// Calls show(model) with new data, and with model.error set when the server does not answer.
export function watch(show) {
  const model = {
    server: null, ports: [], byName: new Map(), connections: [],
    rounds: 0, interval: null, heard: null, error: null,
  };
  let revision = "";
  let timer = 0;
  let busy = false;

  async function round() {
    if (busy || document.hidden) return;
    busy = true;
    clearTimeout(timer);
    try {
      const links = await read("/api/connections?wait=0");
      const names = await read(`/api/names?wait=0&revision=${revision}`);
      model.server = names.server;
      if (!names.unchanged) {
        revision = names.revision;
        model.ports = names.names;
      }
      Object.assign(model, {
        connections: links.connections, rounds: links.rounds, interval: links.interval,
        heard: new Date(), error: null,
      });
      join(model);
    } catch (error) {
      model.error = error;
    }
    busy = false;
    show(model);
    const first = model.interval !== null && model.rounds === 0 && !model.error;
    const pause = first ? FIRST_FETCH_DELAY_MS : Math.max(MIN_FETCH_INTERVAL_MS, 1000 * (model.interval ?? 5));
    timer = setTimeout(round, pause);
  }

  document.addEventListener("visibilitychange", round);
  round();
}

async function read(address) {
  const response = await fetch(address, { signal: AbortSignal.timeout(FETCH_TIMEOUT_MS) });
  if (!response.ok) throw new Error(`${address}: ${response.status}`);
  return response.json();
}

// Adds to every port its connections and the text for the search.
function join(model) {
  model.byName = new Map();
  for (const port of model.ports) {
    port.inputs = [];
    port.outputs = [];
    port.owner = owner(port.process);
    port.place = `${port.host}:${port.port}`;
    port.text ??= [
      port.name, port.place, port.owner, port.process?.arguments, port.type, port.carrier,
    ].join("\n").toLowerCase();
    model.byName.set(port.name, port);
  }
  for (const link of model.connections) {
    link.passed = link.sent ?? link.received;
    link.carrier ??= "";
    link.text = `${link.from}\n${link.to}\n${link.carrier}`.toLowerCase();
    model.byName.get(link.from)?.outputs.push(link);
    model.byName.get(link.to)?.inputs.push(link);
  }
  for (const port of model.ports) {
    port.rateIn = sum(port.inputs);
    port.rateOut = sum(port.outputs);
  }
}

// Messages per second over all these connections; null without counters.
function sum(links) {
  const rates = links.map(rate).filter((rate) => rate !== null);
  return rates.length ? rates.reduce((a, b) => a + b) : null;
}

export const rate = (link) => link.passed?.messages_per_second ?? null;

function owner(process) {
  if (!process) return "";
  const name = process.name?.split("/").pop();
  const pid = process.pid ?? "?";
  return name ? `${name} (${pid})` : `process ${pid}`;
}

// Returns true if the text contains every word of the search.
export function matcher(search) {
  const words = search.toLowerCase().split(/\s+/).filter(Boolean);
  return (text) => words.every((word) => text.includes(word));
}

export function perSecond(rate) {
  return rate === null || rate === undefined ? "" : `${figure(rate)}/s`;
}

export function bytesPerSecond(rate) {
  return rate === null || rate === undefined ? "" : `${bytes(rate)}/s`;
}

export function bytes(count) {
  const units = ["B", "kB", "MB", "GB", "TB"];
  let unit = 0;
  while (count >= 1000 && unit < units.length - 1) {
    count /= 1000;
    unit += 1;
  }
  return `${figure(count)} ${units[unit]}`;
}

export function seconds(time) {
  if (time === null || time === undefined) return "";
  return Math.abs(time) < 1 ? `${Math.round(time * 1000)} ms` : `${figure(time)} s`;
}

function figure(number) {
  return Math.abs(number) < 9.95 && !Number.isInteger(number)
    ? number.toFixed(1)
    : Math.round(number).toLocaleString("en");
}

// Symbol of a state, beside its colour.
export const STATES = {
  alive: { sign: "●", words: "alive", title: "It answered when it was last looked at, or says by itself that it is there" },
  unreachable: { sign: "▲", words: "unreachable", title: "It does not answer, or not in time" },
  gone: { sign: "✕", words: "gone", title: "Nobody listens where it should be" },
  absent: { sign: "◌", words: "not registered", title: "A port names it, the name server does not know it" },
};

// Creates an element with a class and a text; never markup.
export function element(tag, className = "", text = "") {
  const made = document.createElement(tag);
  if (className) made.className = className;
  if (text !== "") made.textContent = text;
  return made;
}

export function stateBadge(state) {
  const { sign, words, title } = STATES[state] ?? STATES.absent;
  const badge = element("span", `state ${state}`);
  badge.title = title;
  const mark = element("span", "sign", sign);
  mark.setAttribute("aria-hidden", "true");
  badge.append(mark, words);
  return badge;
}
