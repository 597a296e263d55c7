// The table, its baskets and the objects on it.

import * as THREE from "three";

const THICKNESS = 0.03;
const WALL = 0.01;
const FLOOR = -0.8;

export class Table {
  // `material` returns the material for roughness, colour and the like.
  constructor(scene, material) {
    this.material = material;
    this.group = new THREE.Group();
    this.objects = new Map();
    this.furniture = "";
    scene.add(this.group);
  }

  set({ table, baskets, objects }) {
    const text = JSON.stringify([table, baskets]);
    if (text !== this.furniture) {
      this.furniture = text;
      this.build(table, baskets);
    }
    const seen = new Set();
    for (const object of objects) {
      const key = `${object.id} ${object.shape} ${object.size} ${object.colour}`;
      seen.add(key);
      let mesh = this.objects.get(key);
      if (!mesh) {
        mesh = shape(object, this.material);
        this.objects.set(key, mesh);
        this.group.add(mesh);
      }
      const [x, y, z, w, i, j, k] = object.pose;
      mesh.position.set(x, y, z);
      mesh.quaternion.set(i, j, k, w);
    }
    for (const [key, mesh] of this.objects) {
      if (seen.has(key)) continue;
      this.group.remove(mesh);
      this.objects.delete(key);
    }
  }

  build(table, baskets) {
    for (const part of this.parts ?? []) this.group.remove(part);
    this.parts = [];
    const box = (material, place, size) => {
      const mesh = new THREE.Mesh(new THREE.BoxGeometry(...size), material);
      mesh.position.set(...place);
      mesh.castShadow = true;
      mesh.receiveShadow = true;
      this.parts.push(mesh);
      this.group.add(mesh);
    };
    if (table) {
      const [surface, x0, x1, y0, y1] = table;
      const wood = this.material({ map: grain(), roughness: 0.55 });
      const legs = this.material({ color: 0x3b4148, roughness: 0.5, metalness: 0.4 });
      box(wood, [(x0 + x1) / 2, (y0 + y1) / 2, surface - THICKNESS / 2], [x1 - x0, y1 - y0, THICKNESS]);
      const height = surface - THICKNESS - FLOOR;
      for (const x of [x0 + 0.04, x1 - 0.04]) {
        for (const y of [y0 + 0.04, y1 - 0.04]) box(legs, [x, y, FLOOR + height / 2], [0.04, 0.04, height]);
      }
    }
    const weave = this.material({ color: 0x9a6b3f, roughness: 0.9 });
    for (const [x, y, z, length, width, depth] of baskets) {
      box(weave, [x, y, z - WALL / 2], [length + 2 * WALL, width + 2 * WALL, WALL]);
      for (const side of [-1, 1]) {
        box(weave, [x + side * (length + WALL) / 2, y, z + depth / 2], [WALL, width, depth]);
        box(weave, [x, y + side * (width + WALL) / 2, z + depth / 2], [length + 2 * WALL, WALL, depth]);
      }
    }
  }
}

// The texture of the table: lines of wood, drawn once.
function grain() {
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = 512;
  const paint = canvas.getContext("2d");
  paint.fillStyle = "#b98d5e";
  paint.fillRect(0, 0, 512, 512);
  let seed = 7;
  const chance = () => (seed = (seed * 16807) % 2147483647) / 2147483647;
  for (let line = 0; line < 260; line += 1) {
    paint.strokeStyle = `rgba(${80 + chance() * 40}, ${50 + chance() * 25}, 25, ${0.05 + chance() * 0.13})`;
    paint.lineWidth = 0.5 + chance() * 2.5;
    const y = chance() * 512, bend = (chance() - 0.5) * 22;
    paint.beginPath();
    paint.moveTo(0, y);
    paint.bezierCurveTo(170, y + bend, 340, y - bend, 512, y + bend / 2);
    paint.stroke();
  }
  const texture = new THREE.CanvasTexture(canvas);
  texture.colorSpace = THREE.SRGBColorSpace;
  texture.anisotropy = 4;
  return texture;
}

function shape({ shape, size, colour }, make) {
  const [r, g, b, a] = colour ?? [0.6, 0.6, 0.6, 1];
  const material = make({ roughness: 0.45, transparent: a < 1, opacity: Math.max(a, 0.35), side: shape === "cup" ? THREE.DoubleSide : THREE.FrontSide });
  material.color.setRGB(r, g, b);
  const mesh = new THREE.Mesh(geometry(shape, size), material);
  mesh.castShadow = true;
  mesh.receiveShadow = true;
  return mesh;
}

// Geometry whose z axis is up.
function geometry(shape, [a, b, c]) {
  switch (shape) {
    case "cylinder":
      return new THREE.CylinderGeometry(a, a, b, 48).rotateX(Math.PI / 2);
    case "cup": {
      const outline = [[0, 0], [a, 0], [a, b], [a - c, b], [a - c, c], [0, c]];
      const points = outline.map(([radius, height]) => new THREE.Vector2(radius, height - b / 2));
      return new THREE.LatheGeometry(points, 48).rotateX(Math.PI / 2);
    }
    case "prism":
      // A side of the triangle is along y at negative x.
      return new THREE.CylinderGeometry(a / Math.sqrt(3), a / Math.sqrt(3), b, 3, 1).rotateX(Math.PI / 2).rotateZ(Math.PI / 2);
    default:
      return new THREE.BoxGeometry(a, b ?? a, c ?? a);
  }
}
