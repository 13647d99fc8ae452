// A camera path through keyframes: the way between them goes around what both look at, as `render --between` goes.

import { lookAt } from './poses.js';
import { along, quaternionOf, slerp, turnedBy } from './rotations.js';
import { state } from './state.js';
import { add, cross, dot, length, sub, times, unit } from './vectors.js';

// Frames a second of a path, played and rendered.
export const RATE = 24;

const axesOf = ({ right, down, forward }) => [right, down, forward];
const mixed = (a, b, share) => add(a, times(sub(b, a), share));

// Height above the focus along the world's up, distance from that axis, and angle around it.
function placeOf({ pose, focus }, ahead) {
  const offset = sub(pose.centre, focus);
  const height = dot(offset, state.scene.up);
  const flat = sub(offset, times(state.scene.up, height));
  return { height, radius: length(flat), angle: Math.atan2(dot(flat, cross(state.scene.up, ahead)), dot(flat, ahead)) };
}

// Straight from one keyframe to the next: where a camera is above its focus there is no way around it.
function straightBetween(from, to, share) {
  const turn = slerp(quaternionOf(axesOf(from.pose)), quaternionOf(axesOf(to.pose)), share);
  const [right, down, forward] = [[1, 0, 0], [0, 1, 0], [0, 0, 1]].map((axis) => turnedBy(turn, axis));
  return { right, down, forward, centre: mixed(from.pose.centre, to.pose.centre, share) };
}

function between(from, to, share) {
  const { up, distance } = state.scene;
  const offset = sub(from.pose.centre, from.focus);
  const ahead = unit(sub(offset, times(up, dot(offset, up))));
  const places = [from, to].map((own) => placeOf(own, ahead));
  if (places.some((place) => place.radius < 1e-3 * distance)) return straightBetween(from, to, share);
  const [first, last] = places;
  const value = (key) => first[key] + share * (last[key] - first[key]);
  const focus = mixed(from.focus, to.focus, share);
  const flat = add(times(ahead, Math.cos(value('angle'))), times(cross(up, ahead), Math.sin(value('angle'))));
  const centre = add(focus, add(times(up, value('height')), times(flat, value('radius'))));
  // How each camera is turned against one that looks at its focus.
  const turns = [from, to].map(({ pose, focus: own }) => {
    const level = axesOf(lookAt(pose.centre, own, up));
    return quaternionOf(axesOf(pose).map((axis) => along(level, axis)));
  });
  const turn = slerp(...turns, share);
  const level = axesOf(lookAt(centre, focus, up));
  const world = (axis) => turnedBy(turn, axis).reduce((sum, own, i) => add(sum, times(level[i], own)), [0, 0, 0]);
  const [right, down, forward] = [[1, 0, 0], [0, 1, 0], [0, 0, 1]].map(world);
  return { right, down, forward, centre };
}

// The pose at a share of the way through all keyframes, each piece in the same time.
export function poseAt(keyframes, share) {
  const place = share * (keyframes.length - 1);
  const piece = Math.min(Math.floor(place), Math.max(keyframes.length - 2, 0));
  return keyframes.length < 2 ? keyframes[0].pose : between(keyframes[piece], keyframes[piece + 1], place - piece);
}

// As many poses as the path has frames, both ends included.
export function posesOf(keyframes, frames) {
  return Array.from({ length: frames }, (_, frame) => poseAt(keyframes, frames > 1 ? frame / (frames - 1) : 0));
}
