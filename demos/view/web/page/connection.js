// The web sockets of a view: a stream that it writes, and another for commands.
//
// Data frames of a port are command blocks of 8 bytes, each followed by a bottle in binary form.

const RECONNECT_DELAY_MS = 1000;
const COMMAND_TIMEOUT_MS = 5000;
const LIST = 256;
const INT32 = 1, STRING = 4, FLOAT64 = 10, VOCAB = 9, BLOB = 12;

const texts = new TextDecoder();
const block = (letter) => new Uint8Array([0, 0, 0, 0, 0x7e, letter.charCodeAt(0), 0, 1]);
const address = () => `${location.protocol.replace("http", "ws")}//${location.host}/?ws`;

// Reads the items of a bottle: numbers, strings and blobs.
export function decode(buffer) {
  const view = new DataView(buffer);
  let at = 0;
  const int = () => view.getInt32((at += 4) - 4, true);
  const bytes = () => {
    const length = int();
    const found = new Uint8Array(buffer, at, length);
    at += length;
    return found;
  };
  const item = (code) => {
    if (code === STRING) return texts.decode(bytes()).replace(/\0$/, "");
    if (code === BLOB) return bytes();
    if (code === INT32) return int();
    if (code === FLOAT64) return view.getFloat64((at += 8) - 8, true);
    if (code === VOCAB) return String.fromCharCode(...new Uint8Array(buffer, (at += 4) - 4, 4)).replace(/\0+$/, "");
    if (code & LIST) return list(code);
    throw new Error(`a bottle with an item of unknown kind ${code}`);
  };
  const list = (code) => {
    const kind = code & ~LIST;
    return Array.from({ length: int() }, () => item(kind || int()));
  };
  return list(int());
}

// Writes a bottle of strings, whole numbers and { number } behind a command block.
export function encode(items) {
  const parts = [block("d")];
  const int = (value) => parts.push(new Uint8Array(new Int32Array([value]).buffer));
  int(LIST);
  int(items.length);
  for (const item of items) {
    if (typeof item === "string") {
      const text = new TextEncoder().encode(item);
      int(STRING);
      int(text.length);
      parts.push(text);
    } else if (item.number !== undefined) {
      int(FLOAT64);
      parts.push(new Uint8Array(new Float64Array([item.number]).buffer));
    } else {
      int(INT32);
      int(item);
    }
  }
  // One array: a browser sends the parts of a blob only after it has read them elsewhere.
  const message = new Uint8Array(parts.reduce((sum, part) => sum + part.length, 0));
  let at = 0;
  for (const part of parts) {
    message.set(part, at);
    at += part.length;
  }
  return message;
}

// Calls show(message, blob) for each message of the view, and status(word) when the connection changes.
export function watch(show, status) {
  const socket = new WebSocket(address());
  socket.binaryType = "arraybuffer";
  socket.onopen = () => {
    socket.send(block("r"));
    status("open");
  };
  let isData = false;
  socket.onmessage = ({ data }) => {
    const isBlock = !isData && data.byteLength === 8 && new Uint8Array(data)[4] === 0x7e;
    isData = isBlock;
    if (isBlock) return;
    const [text, blob] = decode(data);
    show(JSON.parse(text), blob);
  };
  socket.onclose = () => {
    status("lost");
    setTimeout(() => watch(show, status), RECONNECT_DELAY_MS);
  };
}

// Commands, answered in their order. A command that is not answered in time is reported as refused.
export class Commands {
  waiting = [];
  ready = null;

  send(...items) {
    return new Promise((done) => {
      const timer = setTimeout(() => this.settle(entry, ["refused", "the view does not answer"]), COMMAND_TIMEOUT_MS);
      const entry = { done, timer };
      this.waiting.push(entry);
      const message = encode(items);
      if (this.ready) {
        this.ready.send(message);
        return;
      }
      this.open().then((socket) => socket.send(message), () => {
        this.settle(entry, ["refused", "no connection to the view"]);
      });
    });
  }

  settle(entry, reply) {
    clearTimeout(entry.timer);
    this.waiting = this.waiting.filter((other) => other !== entry);
    entry.done(reply);
  }

  // Keeps a connection open, so that the next command does not wait for one.
  keep() {
    this.open().catch(() => {});
    setTimeout(() => this.keep(), RECONNECT_DELAY_MS);
  }

  open() {
    this.socket ??= new Promise((opened, failed) => {
      const socket = new WebSocket(address());
      socket.binaryType = "arraybuffer";
      socket.onopen = () => {
        this.ready = socket;
        opened(socket);
      };
      socket.onmessage = ({ data }) => {
        if (this.waiting.length) this.settle(this.waiting[0], decode(data));
      };
      socket.onclose = () => {
        this.socket = this.ready = null;
        for (const entry of [...this.waiting]) this.settle(entry, ["refused", "the view closed the connection"]);
        failed(new Error("closed"));
      };
    });
    return this.socket;
  }
}
