// A line of many points whose memory is allocated once.

import { Line2 } from "three/examples/jsm/lines/Line2.js";
import { LineGeometry } from "three/examples/jsm/lines/LineGeometry.js";
import { LineMaterial } from "three/examples/jsm/lines/LineMaterial.js";

export class Polyline {
  constructor(scene, most, material) {
    this.most = most;
    const geometry = new LineGeometry();
    geometry.setPositions(new Float32Array(3 * most));
    if (material.vertexColors) geometry.setColors(new Float32Array(3 * most));
    this.line = new Line2(geometry, new LineMaterial({ worldUnits: false, transparent: true, ...material }));
    this.line.visible = false;
    this.line.frustumCulled = false;
    scene.add(this.line);
  }

  set visible(visible) {
    this.line.visible = visible;
  }

  // Draws `count` points: point(index, array, offset) writes three coordinates, colour does the same, if there is one.
  set(count, point, colour) {
    count = Math.min(count, this.most);
    const { geometry } = this.line;
    this.write(geometry.attributes.instanceStart.data, count, point);
    if (colour) this.write(geometry.attributes.instanceColorStart.data, count, colour);
    geometry.instanceCount = Math.max(0, count - 1);
  }

  // A segment has both of its ends: each inner point is in two of them.
  write(buffer, count, fill) {
    const { array } = buffer;
    for (let index = 0; index < count - 1; index += 1) {
      fill(index, array, 6 * index);
      fill(index + 1, array, 6 * index + 3);
    }
    buffer.needsUpdate = true;
  }
}
