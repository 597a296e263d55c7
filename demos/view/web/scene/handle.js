// The handle at the tool: dragging it guides the arm.

import * as THREE from "three";

const RADIUS = 0.03;
// The handle is taken within this distance of the pointer, in pixels: fingers are wide.
const REACH_PX = 26;
const COLOUR = 0xf2a33a;

export class Handle {
  // `guide` is called with the place that the tool should come to.
  constructor(scene, guide) {
    this.scene = scene;
    this.guide = guide;
    this.enabled = false;
    this.grip = null;
    this.plane = new THREE.Plane();
    this.ray = new THREE.Raycaster();
    this.point = new THREE.Vector3();
    this.mesh = new THREE.Mesh(
      new THREE.SphereGeometry(RADIUS, 24, 16),
      new THREE.MeshBasicMaterial({ color: COLOUR, transparent: true, opacity: 0.55, depthTest: false }),
    );
    this.mesh.renderOrder = 2;
    this.mesh.visible = false;
    scene.scene.add(this.mesh);
    const { canvas } = scene;
    // Before the controls of the camera, which listen on the same element.
    canvas.addEventListener("pointerdown", (event) => this.take(event), { capture: true });
    canvas.addEventListener("pointermove", (event) => this.move(event));
    for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, () => this.release());
  }

  setEnabled(enabled) {
    this.enabled = enabled;
    this.mesh.visible = enabled;
    if (!enabled) this.release();
    this.scene.isDirty = true;
  }

  // The tool has moved; a handle that is held stays with the pointer.
  follow(place) {
    if (!this.grip) this.mesh.position.copy(place);
  }

  // Returns where a pointer is, -1 to 1 from edge to edge.
  pointer({ clientX, clientY }) {
    const { left, top, width, height } = this.scene.canvas.getBoundingClientRect();
    return new THREE.Vector2(((clientX - left) / width) * 2 - 1, 1 - ((clientY - top) / height) * 2);
  }

  take(event) {
    if (!this.enabled || event.button !== 0) return;
    const { canvas, camera, controls } = this.scene;
    const at = this.pointer(event);
    const seen = this.mesh.position.clone().project(camera);
    const distance = Math.hypot((seen.x - at.x) * canvas.clientWidth, (seen.y - at.y) * canvas.clientHeight) / 2;
    if (distance > REACH_PX) return;
    // It moves in the plane through it that faces the camera.
    this.plane.setFromNormalAndCoplanarPoint(camera.getWorldDirection(new THREE.Vector3()), this.mesh.position);
    this.grip = new THREE.Vector3();
    if (this.under(event)) this.grip.subVectors(this.mesh.position, this.point);
    canvas.setPointerCapture(event.pointerId);
    controls.enabled = false;
    this.mesh.material.opacity = 0.9;
    this.scene.isDirty = true;
  }

  // Finds the point of the plane under a pointer; returns false if there is none.
  under(event) {
    this.ray.setFromCamera(this.pointer(event), this.scene.camera);
    return this.ray.ray.intersectPlane(this.plane, this.point) !== null;
  }

  move(event) {
    if (!this.grip || !this.under(event)) return;
    this.mesh.position.addVectors(this.point, this.grip);
    this.scene.isDirty = true;
    this.guide(this.mesh.position.toArray());
  }

  release() {
    if (!this.grip) return;
    this.grip = null;
    this.scene.controls.enabled = true;
    this.mesh.material.opacity = 0.55;
    this.scene.isPosed = this.scene.isDirty = true;
  }
}
