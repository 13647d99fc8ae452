// A view that turns around a point: { pose, focus }. `scene` is { up, distance, lens }: the direction up and the usual
// distance of cameras in the world, and the intrinsics of the picture.

import { turnedPose } from './poses.js';
import { add, clamp, cross, dot, length, sub, times, unit } from './vectors.js';

const TOP = 0.05;            // radians that are kept from the pole

// Radians around the direction up, and above the horizon.
export function turnedView({ pose, focus }, { up }, around, above) {
  const turnedAround = turnedPose(pose, focus, up, around);
  const offset = sub(turnedAround.centre, focus);
  const height = Math.acos(clamp(dot(unit(offset), up), -1, 1));
  // Not over the pole.
  const angle = clamp(height - above, TOP, Math.PI - TOP) - height;
  const across = cross(up, offset);
  return { pose: length(across) > 1e-6 ? turnedPose(turnedAround, focus, unit(across), angle) : turnedAround, focus };
}

// Nearer or farther by a factor.
export function movedView({ pose, focus }, scene, factor) {
  const offset = sub(pose.centre, focus);
  const distance = clamp(length(offset) * factor, 0.05 * scene.distance, 20 * scene.distance);
  return { pose: { ...pose, centre: add(focus, times(unit(offset), distance)) }, focus };
}

// Sideways, in shares of the picture's width.
export function pannedView({ pose, focus }, { lens }, across, below) {
  const width = length(sub(pose.centre, focus)) * lens.size[0] / lens.focal[0];
  const offset = add(times(pose.right, -across * width), times(pose.down, -below * width));
  return { pose: { ...pose, centre: add(pose.centre, offset) }, focus: add(focus, offset) };
}

// What hands do to a view: `read` gives the view and its scene, `show` takes the view that comes of them.
export function orbitActions(read, show) {
  const change = (become) => (...by) => show(become(...read(), ...by));
  return { turn: change(turnedView), move: change(movedView), pan: change(pannedView) };
}
