// The robot, the table and the plan in 3D.

import * as THREE from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import { RoomEnvironment } from "three/examples/jsm/environments/RoomEnvironment.js";
import { OBJLoader } from "three/examples/jsm/loaders/OBJLoader.js";
import URDFLoader from "urdf-loader";
import { Handle } from "./handle.js";
import { Polyline } from "./polyline.js";
import { Table } from "./table.js";

const FLOOR = -0.8;
const BASE = -0.346;
// Distance of the tool plate from the last joint, and the ratio of outer to inner links of the fingers.
const TOOL_PLATE = 0.0609;
const COUPLING = 1 / 3;
const TRAIL_SECONDS = 12;
const TRAIL_STEP = 0.004;
const MAX_TRAIL = 400;
const MAX_PLAN = 500;
// Shortest time between two readouts of the tool.
const READOUT_INTERVAL_MS = 100;
// Quality is lowered while frames take longer than the first, and raised again while they take less than the second.
const SLOW_FRAME_MS = 33;
const FAST_FRAME_MS = 18;
// Time after a level was too slow until it is tried again.
const RAISE_INTERVAL_MS = 20_000;
// Number of frames whose median decides.
const FRAMES_JUDGED = 11;
// Resolution relative to the window's, and the size of the shadow's image (0: no shadow).
const LEVELS = [
  { ratio: 0.5, shadow: 0 },
  { ratio: 0.5, shadow: 512 },
  { ratio: 0.75, shadow: 1024 },
  { ratio: 1, shadow: 2048 },
  { ratio: 1.5, shadow: 2048 },
  { ratio: 2, shadow: 2048 },
];
const FIRST_LEVEL = 3;
// The first level without a graphics card.
const SOFTWARE_LEVEL = 0;

const SURFACES = {
  shell: { roughness: 0.38, metalness: 0.1 },
  graphite: { roughness: 0.5, metalness: 0.35 },
  metal: { roughness: 0.28, metalness: 0.85 },
  accent: { roughness: 0.4, metalness: 0.2 },
  rubber: { roughness: 0.9, metalness: 0 },
};

const VIEWS = {
  default: { eye: [1.75, -1.35, 0.85], target: [0.18, 0, 0.05] },
  top: { eye: [0.35, -0.001, 2.4], target: [0.35, 0, -0.1] },
  side: { eye: [0.25, -2.3, 0.25], target: [0.25, 0, 0.05] },
};

THREE.Object3D.DEFAULT_UP.set(0, 0, 1);

export class Scene {
  // `guide` is called with the place that the tool is dragged to; `full` asks for the best quality, whatever it costs.
  constructor(canvas, { urdf, readout, failed, guide, full }) {
    this.canvas = canvas;
    this.isFull = full;
    this.readout = readout;
    this.robot = null;
    this.trail = [];
    this.frames = [];
    this.isDirty = true;
    this.isPosed = true;
    this.readoutAt = -Infinity;
    this.place = new THREE.Vector3();
    this.options = { trail: true, frames: false };
    this.isSoftware = !full && drawsInSoftware();
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: !this.isSoftware });
    this.renderer.shadowMap.enabled = true;
    // Shadows are drawn when a body has moved, not when the camera has.
    this.renderer.shadowMap.autoUpdate = false;
    this.renderer.shadowMap.type = THREE.PCFShadowMap;
    this.renderer.toneMapping = THREE.ACESFilmicToneMapping;
    this.scene = new THREE.Scene();
    this.camera = new THREE.PerspectiveCamera(38, 1, 0.05, 30);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.enableDamping = true;
    this.controls.maxPolarAngle = 0.54 * Math.PI;
    this.controls.minDistance = 0.4;
    this.controls.maxDistance = 6;
    this.controls.addEventListener("change", () => (this.isDirty = true));
    this.look("default");
    this.light();
    this.ground();
    this.lines();
    this.table = new Table(this.scene, (options) => this.material(options));
    this.markers = new THREE.Group();
    this.scene.add(this.markers);
    this.frameTimes = [];
    this.loweredAt = -Infinity;
    this.setLevel(this.isSoftware ? SOFTWARE_LEVEL : full ? LEVELS.length - 2 : FIRST_LEVEL);
    this.handle = new Handle(this, guide);
    this.theme = matchMedia("(prefers-color-scheme: dark)");
    this.theme.addEventListener("change", () => this.paint());
    this.paint();
    new ResizeObserver(() => this.resize()).observe(canvas);
    this.resize();
    this.load(urdf, failed);
  }

  // Returns a material: without a graphics card one that costs a fraction per pixel.
  material({ roughness, metalness = 0, ...options }) {
    if (this.isSoftware) return new THREE.MeshLambertMaterial(options);
    return new THREE.MeshStandardMaterial({ ...options, roughness, metalness });
  }

  light() {
    if (this.isSoftware) {
      this.sky = new THREE.HemisphereLight(0xffffff, 0x8a8f96, 1.6);
      this.sky.position.set(0, 0, 1);
      this.scene.add(this.sky);
    } else {
      const maker = new THREE.PMREMGenerator(this.renderer);
      this.scene.environment = maker.fromScene(new RoomEnvironment(), 0.04).texture;
      maker.dispose();
    }
    this.sun = new THREE.DirectionalLight(0xffffff, 2.2);
    this.sun.position.set(1.1, -1.5, 2.6);
    this.sun.target.position.set(0.3, 0, -0.2);
    this.sun.castShadow = true;
    this.sun.shadow.mapSize.set(2048, 2048);
    this.sun.shadow.radius = 4;
    this.sun.shadow.bias = -0.0004;
    this.sun.shadow.normalBias = 0.01;
    Object.assign(this.sun.shadow.camera, { left: -1.5, right: 1.5, top: 1.5, bottom: -1.5, near: 0.5, far: 6 });
    this.scene.add(this.sun, this.sun.target);
  }

  ground() {
    this.floor = new THREE.Mesh(new THREE.CircleGeometry(9, 48), this.material({ roughness: 0.95 }));
    this.floor.position.z = FLOOR;
    this.floor.receiveShadow = true;
    this.grid = new THREE.GridHelper(12, 48);
    this.grid.rotation.x = Math.PI / 2;
    this.grid.position.z = FLOOR + 0.001;
    this.grid.material.transparent = true;
    const pedestal = new THREE.Mesh(
      new THREE.CylinderGeometry(0.125, 0.16, BASE - FLOOR - 0.02, 48),
      this.material({ color: 0x2a2f36, roughness: 0.6, metalness: 0.3 }),
    );
    const foot = new THREE.Mesh(new THREE.CylinderGeometry(0.3, 0.3, 0.02, 64), pedestal.material);
    for (const [mesh, z] of [[pedestal, (BASE + FLOOR + 0.02) / 2], [foot, FLOOR + 0.01]]) {
      mesh.rotation.x = Math.PI / 2;
      mesh.position.z = z;
      mesh.castShadow = true;
      mesh.receiveShadow = true;
      this.scene.add(mesh);
    }
    this.scene.add(this.floor, this.grid);
  }

  lines() {
    this.trailLine = new Polyline(this.scene, MAX_TRAIL, { linewidth: 2.5, vertexColors: true });
    this.planLine = new Polyline(this.scene, MAX_PLAN, { linewidth: 3.5, color: 0x19a979, opacity: 0.9 });
    this.near = new THREE.Color(0x2f9bea);
    this.faded = new THREE.Color();
    this.axes = new THREE.AxesHelper(0.14);
    this.axes.visible = false;
  }

  load(urdf, failed) {
    const loader = new URDFLoader();
    const objects = new OBJLoader();
    const materials = {};
    loader.loadMeshCb = (path, manager, material, done) => {
      objects.load(path, (group) => {
        const mesh = group.children[0];
        const name = material?.name ?? "shell";
        materials[name] ??= this.material({ color: material?.color ?? 0xcccccc, ...(SURFACES[name] ?? {}) });
        mesh.material = materials[name];
        mesh.castShadow = true;
        mesh.receiveShadow = true;
        done(mesh);
        this.isPosed = this.isDirty = true;
      }, undefined, (error) => done(null, error));
    };
    loader.load(urdf, (robot) => {
      this.robot = robot;
      this.scene.add(robot);
      this.tool = new THREE.Object3D();
      this.tool.position.z = TOOL_PLATE;
      robot.links.link7.add(this.tool);
      this.tool.add(this.axes);
      // The frames of the joints, beside the tool's.
      this.frames = [];
      for (let joint = 1; joint <= 7; joint += 1) {
        const axes = new THREE.AxesHelper(0.09);
        axes.visible = this.options.frames;
        robot.links[`link${joint}`]?.add(axes);
        this.frames.push(axes);
      }
      this.isPosed = this.isDirty = true;
    }, undefined, (error) => failed(`The description of the robot cannot be read: ${error.message ?? error}`));
  }

  // Colours of the page, light or dark.
  paint() {
    const dark = this.theme.matches;
    const sky = new THREE.Color(dark ? 0x10171f : 0xdfe6ee);
    this.scene.background = sky;
    this.scene.fog = new THREE.Fog(sky, 3.2, 8.5);
    this.floor.material.color.set(dark ? 0x1a242e : 0xc9d3dd);
    this.grid.material.color.set(dark ? 0x3a4a5a : 0x8fa1b3);
    this.grid.material.opacity = dark ? 0.35 : 0.35;
    this.scene.environmentIntensity = dark ? 0.42 : 0.62;
    if (this.sky) this.sky.intensity = dark ? 1.1 : 1.9;
    this.renderer.toneMappingExposure = dark ? 0.95 : 1.05;
    this.isPosed = this.isDirty = true;
  }

  look(name) {
    const { eye, target } = VIEWS[name] ?? VIEWS.default;
    this.camera.position.set(...eye);
    this.controls.target.set(...target);
    this.controls.update();
    this.isDirty = true;
  }

  setOption(name, value) {
    this.options[name] = value;
    this.axes.visible = this.options.frames;
    for (const axes of this.frames) axes.visible = this.options.frames;
    this.isPosed = this.isDirty = true;
  }

  // Takes a state; the next frame shows the latest one.
  setState(state) {
    this.state = state;
    this.isPosed = this.isDirty = true;
  }

  // Brings the robot to the latest state.
  pose(now) {
    const { state, robot } = this;
    if (!robot || !state) return;
    const radians = Math.PI / 180;
    state.arm?.p.forEach((angle, index) => robot.setJointValue(`joint${index + 1}`, angle * radians));
    const hand = state.hand?.p;
    if (hand) {
      for (let finger = 1; finger <= 3; finger += 1) {
        const inner = hand[finger - 1] * radians;
        robot.setJointValue(`finger${finger}_inner`, inner);
        robot.setJointValue(`finger${finger}_outer`, inner * COUPLING);
        if (finger < 3) robot.setJointValue(`finger${finger}_spread`, (hand[3] ?? 0) * radians);
      }
    }
    robot.updateMatrixWorld(true);
    this.place.setFromMatrixPosition(this.tool.matrixWorld);
    this.handle.follow(this.place);
    if (now - this.readoutAt > READOUT_INTERVAL_MS) {
      this.readoutAt = now;
      this.readout(this.place.x, this.place.y, this.place.z);
    }
    this.follow(state.time);
  }

  follow(time) {
    const { trail, place } = this;
    const last = trail.at(-1);
    if (last && time < last.time) trail.length = 0;
    if (!last || place.distanceTo(last.place) > TRAIL_STEP) trail.push({ place: place.clone(), time });
    while (trail.length > MAX_TRAIL || (trail.length && trail[0].time < time - TRAIL_SECONDS)) trail.shift();
    const isVisible = this.options.trail && trail.length > 1;
    this.trailLine.visible = isVisible;
    if (!isVisible) return;
    this.trailLine.set(trail.length, (index, array, at) => trail[index].place.toArray(array, at), (index, array, at) => {
      const age = Math.min(1, (time - trail[index].time) / TRAIL_SECONDS);
      this.faded.copy(this.near).lerp(this.scene.background, age).toArray(array, at);
    });
  }

  setPlan(plan) {
    const text = JSON.stringify(plan?.path ?? []);
    if (text === this.planText) return;
    this.planText = text;
    const path = plan?.path ?? [];
    this.planLine.visible = path.length > 1;
    this.planLine.set(path.length, (index, array, at) => array.set(path[index], at));
    this.isDirty = true;
  }

  setTable(table) {
    this.table.set(table);
    this.isPosed = this.isDirty = true;
  }

  // Rings where detected objects are said to be.
  setDetections(detections) {
    const text = JSON.stringify(detections?.objects ?? []);
    if (text === this.detectionText) return;
    this.detectionText = text;
    this.markers.clear();
    const ring = new THREE.TorusGeometry(0.045, 0.0025, 8, 40);
    const material = new THREE.MeshBasicMaterial({ color: 0x35c3ff });
    for (const { pose } of detections?.objects ?? []) {
      if (!pose) continue;
      const marker = new THREE.Mesh(ring, material);
      marker.position.set(pose[0], pose[1], pose[2] + 0.004);
      this.markers.add(marker);
    }
    this.isDirty = true;
  }

  resize() {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    if (!width || !height) return;
    this.renderer.setPixelRatio(Math.min(LEVELS[this.level].ratio, devicePixelRatio * 1.0001));
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    // A narrow window shows as much from side to side as a square one.
    this.camera.fov = 2 * Math.atan(Math.tan(19 * Math.PI / 180) * Math.max(1, 1.1 / this.camera.aspect)) * 180 / Math.PI;
    this.camera.updateProjectionMatrix();
    this.isDirty = true;
  }

  // Draws a frame if anything has changed; returns true if it did.
  draw(now) {
    this.controls.update();
    if (!this.isDirty) {
      this.last = null;
      return false;
    }
    if (this.isPosed) {
      this.pose(now);
      this.renderer.shadowMap.needsUpdate = true;
    }
    this.isPosed = this.isDirty = false;
    this.renderer.render(this.scene, this.camera);
    if (!this.isFull) this.adapt();
    return true;
  }

  // Adapts the quality to the speed of this machine.
  adapt() {
    const now = performance.now();
    if (this.last) this.frameTimes.push(now - this.last);
    this.last = now;
    if (this.frameTimes.length < FRAMES_JUDGED) return;
    const middle = this.frameTimes.sort((a, b) => a - b)[FRAMES_JUDGED >> 1];
    this.frameTimes = [];
    const most = LEVELS.findLastIndex(({ ratio }) => ratio <= Math.max(1, devicePixelRatio));
    if (middle > SLOW_FRAME_MS && this.level > 0) {
      this.loweredAt = now;
      this.setLevel(this.level - 1);
    } else if (middle < FAST_FRAME_MS && this.level < most && now - this.loweredAt > RAISE_INTERVAL_MS) {
      this.setLevel(this.level + 1);
    }
  }

  setLevel(level) {
    this.level = level;
    const { shadow } = LEVELS[level];
    this.sun.castShadow = shadow > 0;
    this.sun.shadow.mapSize.set(shadow || 512, shadow || 512);
    this.sun.shadow.map?.dispose();
    this.sun.shadow.map = null;
    this.isPosed = true;
    this.resize();
  }
}

// Returns true without a graphics card: then each pixel costs time.
function drawsInSoftware() {
  const context = document.createElement("canvas").getContext("webgl2");
  const about = context?.getExtension("WEBGL_debug_renderer_info");
  const name = about ? context.getParameter(about.UNMASKED_RENDERER_WEBGL) : "";
  context?.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|softpipe|software/i.test(name);
}
