// Places the boxes of the graph: writers to the left of their readers, in columns.
//
// layout(boxes, links, room) takes boxes { id, width, height, anchors: Map(port -> y) } and links
// { from, to, fromPort, toPort } between ids; it gives every box x and y and every link its points,
// and returns { width, height }. Parts of the network that are not connected with each other are
// laid out alone and packed side by side, to be seen as large as possible in a room of that
// { width, height }. The same input always gives the same layout.

const GAP_X = 120;
const GAP_Y = 16;
const SUBCOLUMN_GAP = 24; // boxes of one column that had to be divided
const PART_GAP = 60; // parts of the network
const MAX_COLUMN_HEIGHT = 1000; // a column that is not divided
const SWEEPS = 10;
const MAX_BENDS = 4000; // beyond, long links go straight

export function layout(boxes, links, room) {
  const byId = new Map(boxes.map((box) => [box.id, box]));
  const parts = components(boxes, links).map((part) => {
    const size = layoutPart(part.boxes.map((id) => byId.get(id)), part.links, byId);
    return { ...part, ...size };
  });
  return pack(parts, byId, room);
}

function components(boxes, links) {
  const parent = new Map(boxes.map((box) => [box.id, box.id]));
  const root = (id) => {
    while (parent.get(id) !== id) {
      parent.set(id, parent.get(parent.get(id)));
      id = parent.get(id);
    }
    return id;
  };
  for (const link of links) parent.set(root(link.from), root(link.to));
  const parts = new Map();
  for (const box of boxes) {
    const id = root(box.id);
    if (!parts.has(id)) parts.set(id, { boxes: [], links: [] });
    parts.get(id).boxes.push(box.id);
  }
  for (const link of links) parts.get(root(link.from)).links.push(link);
  return [...parts.values()];
}

function layoutPart(boxes, links, byId) {
  const edges = oneWay(boxes, links);
  const layer = layers(boxes, edges);
  const columns = fill(boxes, edges, layer, byId);
  order(columns);
  return place(columns, links);
}

// Removes cycles: links that close one are reversed.
function oneWay(boxes, links) {
  const out = new Map(boxes.map((box) => [box.id, []]));
  const balance = new Map(boxes.map((box) => [box.id, 0]));
  for (const link of links) {
    if (link.from === link.to) continue;
    out.get(link.from).push(link);
    balance.set(link.from, balance.get(link.from) + 1);
    balance.set(link.to, balance.get(link.to) - 1);
  }
  const edges = [];
  const state = new Map(); // 1: in progress, 2: done
  const starts = boxes.map((box) => box.id).sort((a, b) => balance.get(b) - balance.get(a));
  for (const start of starts) {
    if (state.has(start)) continue;
    const stack = [{ id: start, next: 0 }];
    state.set(start, 1);
    while (stack.length) {
      const top = stack[stack.length - 1];
      const link = out.get(top.id)[top.next];
      top.next += 1;
      if (!link) {
        state.set(top.id, 2);
        stack.pop();
      } else if (state.get(link.to) === 1) {
        edges.push({ link, from: link.to, to: link.from, turned: true });
      } else {
        edges.push({ link, from: link.from, to: link.to, turned: false });
        if (!state.has(link.to)) {
          state.set(link.to, 1);
          stack.push({ id: link.to, next: 0 });
        }
      }
    }
  }
  return edges;
}

// Computes the column of every box: right of all boxes that it reads from, and close to its readers.
function layers(boxes, edges) {
  const waits = new Map(boxes.map((box) => [box.id, 0]));
  const out = new Map(boxes.map((box) => [box.id, []]));
  for (const edge of edges) {
    waits.set(edge.to, waits.get(edge.to) + 1);
    out.get(edge.from).push(edge.to);
  }
  const layer = new Map(boxes.map((box) => [box.id, 0]));
  const ready = boxes.map((box) => box.id).filter((id) => waits.get(id) === 0);
  for (let at = 0; at < ready.length; at += 1) {
    for (const to of out.get(ready[at])) {
      layer.set(to, Math.max(layer.get(to), layer.get(ready[at]) + 1));
      waits.set(to, waits.get(to) - 1);
      if (waits.get(to) === 0) ready.push(to);
    }
  }
  for (const id of ready.reverse()) {
    const readers = out.get(id);
    if (!readers.length || edges.some((edge) => edge.to === id)) continue;
    layer.set(id, Math.min(...readers.map((to) => layer.get(to))) - 1);
  }
  return layer;
}

// Creates columns of boxes, with a bend in every column that a link passes.
function fill(boxes, edges, layer, byId) {
  const columns = [];
  const column = (index) => (columns[index] ??= []);
  const cells = new Map();
  for (const box of boxes) {
    const cell = { box, width: box.width, height: box.height, left: [], right: [] };
    cells.set(box.id, cell);
    column(layer.get(box.id)).push(cell);
  }
  let bends = 0;
  for (const { link, from, to, turned } of edges) {
    link.bends = [];
    let last = cells.get(from);
    let anchor = byId.get(from).anchors.get(turned ? link.toPort : link.fromPort);
    for (let at = layer.get(from) + 1; at < layer.get(to) && bends < MAX_BENDS; at += 1) {
      const bend = { box: null, width: 0, height: 6, left: [], right: [] };
      bends += 1;
      column(at).push(bend);
      join(last, anchor, bend, 3);
      link.bends.push(bend);
      last = bend;
      anchor = 3;
    }
    const end = cells.get(to);
    join(last, anchor, end, byId.get(to).anchors.get(turned ? link.fromPort : link.toPort));
    if (turned) link.bends.reverse();
  }
  return columns.filter(Boolean);
}

// `by` is how much lower the one end of the link is in its cell than the other in its own.
function join(left, leftAnchor, right, rightAnchor) {
  left.right.push({ cell: right, by: rightAnchor - leftAnchor });
  right.left.push({ cell: left, by: leftAnchor - rightAnchor });
}

// Sorts every column so that links cross little: each cell goes to the middle of its neighbours.
function order(columns) {
  for (const cells of columns) number(cells);
  for (let sweep = 0; sweep < SWEEPS; sweep += 1) {
    const down = sweep % 2 === 0;
    for (const cells of down ? columns : [...columns].reverse()) {
      for (const cell of cells) {
        const near = down ? cell.left : cell.right;
        cell.wish = near.length
          ? near.reduce((total, { cell: other }) => total + other.rank, 0) / near.length
          : cell.rank;
      }
      cells.sort((a, b) => a.wish - b.wish);
      number(cells);
    }
  }
}

function number(cells) {
  cells.forEach((cell, index) => {
    cell.rank = (index + 0.5) / cells.length;
  });
}

// Converts ranks to coordinates.
function place(columns, links) {
  const split = columns.map(divide);
  const stacks = split.flat();
  for (const cells of stacks) stack(cells);
  for (let sweep = 0; sweep < SWEEPS; sweep += 1) {
    const down = sweep % 2 === 0;
    for (const cells of down ? stacks : [...stacks].reverse()) settle(cells, down ? "left" : "right");
  }
  const top = Math.min(...stacks.flat().map((cell) => cell.y));
  let [x, height] = [0, 0];
  for (const parts of split) {
    const widest = Math.max(0, ...parts.flat().map((cell) => cell.width));
    const span = parts.length * (widest + SUBCOLUMN_GAP) - SUBCOLUMN_GAP;
    parts.forEach((cells, index) => {
      for (const cell of cells) {
        cell.y -= top;
        height = Math.max(height, cell.y + cell.height);
        if (cell.box) Object.assign(cell.box, { x: x + index * (widest + SUBCOLUMN_GAP), y: cell.y });
        else Object.assign(cell, { x, span });
      }
    });
    x += span + GAP_X;
  }
  for (const link of links) {
    link.points = (link.bends ?? []).map((bend) => ({ x: bend.x, y: bend.y + 3, width: bend.span }));
    delete link.bends;
  }
  return { width: x - GAP_X, height };
}

// Splits a very long column; neighbours stay at about the same height.
function divide(cells) {
  const boxes = cells.filter((cell) => cell.box);
  const widest = Math.max(0, ...boxes.map((cell) => cell.width));
  const total = boxes.reduce((sum, cell) => sum + cell.height + GAP_Y, 0);
  const tallest = Math.max(MAX_COLUMN_HEIGHT, Math.sqrt(total * (widest + SUBCOLUMN_GAP) * 0.7));
  const count = Math.max(1, Math.ceil(total / tallest));
  const parts = Array.from({ length: count }, () => []);
  cells.forEach((cell, index) => parts[index % count].push(cell));
  return parts;
}

function stack(cells) {
  let y = 0;
  cells.forEach((cell, index) => {
    cell.y = y;
    y += step(cell, cells[index + 1]);
  });
  for (const cell of cells) cell.y -= y / 2;
}

// Minimum distance from a cell to the next one below.
function step(cell, next) {
  return cell.height + (cell.box || next?.box ? GAP_Y : 5);
}

// Moves the cells of a column towards their neighbours; they keep their order and their distance.
function settle(cells, side) {
  const blocks = [];
  let offset = 0;
  for (const [index, cell] of cells.entries()) {
    const near = cell[side];
    const wish = near.length
      ? near.reduce((total, { cell: other, by }) => total + other.y + by, 0) / near.length
      : cell.y;
    const block = { cells: [cell], total: wish - offset, offsets: [offset], count: 1 };
    offset += step(cell, cells[index + 1]);
    blocks.push(block);
    while (blocks.length > 1 && mean(blocks.at(-2)) > mean(blocks.at(-1))) {
      const last = blocks.pop();
      const before = blocks.at(-1);
      before.cells.push(...last.cells);
      before.offsets.push(...last.offsets);
      before.total += last.total;
      before.count += last.count;
    }
  }
  for (const block of blocks) {
    block.cells.forEach((cell, index) => {
      cell.y = mean(block) + block.offsets[index];
    });
  }
}

const mean = (block) => block.total / block.count;

// Packs the parts in rows, large ones first.
function pack(parts, byId, room) {
  parts.sort((a, b) => b.height - a.height || b.width - a.width);
  const scale = ({ width, height }) => Math.max(width / room.width, height / room.height);
  let best = null;
  const widest = Math.max(0, ...parts.map((part) => part.width));
  for (let goal = widest, tries = 0; tries < 24; goal = goal * 1.15 + 50, tries += 1) {
    const packed = rows(parts, goal);
    if (!best || scale(packed) < scale(best)) best = packed;
  }
  parts.forEach((part, index) => {
    const [x, y] = best.places[index];
    for (const id of part.boxes) {
      const box = byId.get(id);
      box.x += x;
      box.y += y;
    }
    for (const link of part.links) {
      for (const point of link.points) {
        point.x += x;
        point.y += y;
      }
    }
  });
  return best;
}

// Places the parts in rows no longer than `goal`.
function rows(parts, goal) {
  let [x, y, row, width] = [0, 0, 0, 0];
  const places = parts.map((part) => {
    if (x > 0 && x + part.width > goal) [x, y, row] = [0, y + row + PART_GAP, 0];
    const at = [x, y];
    row = Math.max(row, part.height);
    width = Math.max(width, x + part.width);
    x += part.width + PART_GAP;
    return at;
  });
  return { places, width, height: y + row };
}
