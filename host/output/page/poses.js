// Poses: { right, down, forward, centre }, the axes of a camera (OpenCV) and its centre in the world.

import { add, cross, dot, sub, turned, unit } from './vectors.js';

export function poseOf(m) {
  const column = (i) => [m[0][i], m[1][i], m[2][i]];
  return { right: column(0), down: column(1), forward: column(2), centre: column(3) };
}

// World from camera, row-major.
export function matrixOf({ right: r, down: d, forward: f, centre: c }) {
  return [0, 1, 2].map((i) => [r[i], d[i], f[i], c[i]]).concat([[0, 0, 0, 1]]);
}

// The same pose with axes that are orthonormal again.
function straight({ right, down, forward, centre }) {
  const ahead = unit(forward);
  const across = unit(cross(down, ahead));
  return { right: across, down: cross(ahead, across), forward: ahead, centre };
}

// The pose turned around an axis through a point.
export function turnedPose(pose, point, axis, angle) {
  const turn = (a) => turned(a, axis, angle);
  const { right, down, forward, centre } = pose;
  return straight({
    right: turn(right), down: turn(down), forward: turn(forward), centre: add(point, turn(sub(centre, point))),
  });
}

export function lookAt(centre, point, up) {
  const forward = unit(sub(point, centre));
  const right = unit(cross(forward, up));
  return { right, down: cross(forward, right), forward, centre };
}

// A world point in camera axes.
export function inCamera(pose, point) {
  const offset = sub(point, pose.centre);
  return [dot(pose.right, offset), dot(pose.down, offset), dot(pose.forward, offset)];
}
