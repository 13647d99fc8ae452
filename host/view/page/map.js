// The map: the cameras and the subject, seen from outside.

import { fitted } from './canvas.js';
import { drawSources } from './frusta.js';
import { NEAR, drawFrustum, frustum } from './outlines.js';
import { inCamera, lookAt } from './poses.js';
import { MIN_SEEN } from './seen.js';
import { element, state } from './state.js';
import { add, cross, dot, length, sub, times, turned, unit } from './vectors.js';

// How the map's camera projects, for a canvas of this size.
function mapProjection(width, height) {
  const focal = 1.6 * height;
  return ([x, y, z]) => [width / 2 + focal * x / z, height / 2 + focal * y / z];
}

// From behind and above the middle of the cameras, far enough to see all of them and the subject.
export function firstObserver() {
  const centres = state.scene.sources.map((source) => source.pose.centre);
  const level = (a) => sub(a, times(state.scene.up, dot(a, state.scene.up)));
  let away = level(sub(times(centres.reduce(add), 1 / centres.length), state.scene.focus));
  if (length(away) < 0.2 * state.scene.distance) away = level(sub(state.scene.start.centre, state.scene.focus));
  const side = unit(cross(state.scene.up, away));
  const direction = turned(turned(unit(away), side, -0.75), state.scene.up, 0.3);
  const all = [state.scene.focus, ...state.scene.sources.flatMap((source) => frustum(source, state.scene.frustum))];
  const ends = [0, 1, 2].map((i) => [Math.min, Math.max].map((end) => end(...all.map((point) => point[i]))));
  const target = ends.map(([least, most]) => (least + most) / 2);
  const { clientWidth: width, clientHeight: height } = element('map');
  const project = mapProjection(width, height);
  const seen = (distance) => {
    const own = lookAt(add(target, times(direction, distance)), target, state.scene.up);
    const fits = all.map((point) => inCamera(own, point)).every((point) => {
      const [x, y] = project(point);
      return point[2] > 0 && x > 0.06 * width && x < 0.94 * width && y > 0.1 * height && y < 0.92 * height;
    });
    return fits ? own : null;
  };
  for (let distance = 0.5 * state.scene.distance; distance < 100 * state.scene.distance; distance *= 1.05) {
    const own = seen(distance);
    if (own !== null) return { target, pose: own };
  }
  return { target, pose: lookAt(add(target, times(direction, 4 * state.scene.distance)), target, state.scene.up) };
}

// The sides from which nothing was photographed, around the subject.
function shadeUnseen(context, eye, project, colour) {
  const { ring, focus } = state.scene;
  context.fillStyle = colour;
  context.globalAlpha = 0.3;
  context.beginPath();
  ring.forEach((own, i) => {
    const next = ring[(i + 1) % ring.length];
    const corners = [focus, own.place, next.place].map((point) => inCamera(eye, point));
    if (Math.max(own.seen, next.seen) >= MIN_SEEN || corners.some((point) => point[2] <= 0)) return;
    corners.forEach((point, k) => (k === 0 ? context.moveTo(...project(point)) : context.lineTo(...project(point))));
    context.closePath();
  });
  context.fill();
  context.globalAlpha = 1;
}

let isMapDue = false;

// Once for each picture of the screen, however often something changes.
export function drawMapSoon() {
  if (isMapDue) return;
  isMapDue = true;
  requestAnimationFrame(() => { isMapDue = false; drawMap(); });
}

export function drawMap() {
  if (state.scene === null) return;
  const canvas = element('map');
  const { context, width, height, ratio } = fitted(canvas);
  const style = getComputedStyle(document.body);
  context.clearRect(0, 0, width, height);
  const project = mapProjection(width, height);
  // From farther away while the novel view's camera would be out of sight.
  let eye = state.observer.pose;
  for (let i = 0; i < 60; i += 1) {
    const tip = inCamera(eye, state.pose.centre);
    const [x, y] = project(tip);
    if (tip[2] > 0 && x > 0.03 * width && x < 0.97 * width && y > 0.03 * height && y < 0.97 * height) break;
    eye = { ...eye, centre: add(state.observer.target, times(sub(eye.centre, state.observer.target), 1.05)) };
  }
  context.font = `${12 * ratio}px system-ui, sans-serif`;
  shadeUnseen(context, eye, project, style.getPropertyValue('--faint'));

  // A ring around the focus, so that the ground can be told.
  const side = unit(cross(state.scene.up, eye.forward));
  const ahead = cross(side, state.scene.up);
  context.beginPath();
  for (let i = 0; i <= 48; i += 1) {
    const angle = i / 24 * Math.PI;
    const point = add(state.focus, times(add(times(side, Math.cos(angle)), times(ahead, Math.sin(angle))), 0.2 * state.scene.distance));
    const [x, y] = project(inCamera(eye, point));
    if (i === 0) context.moveTo(x, y); else context.lineTo(x, y);
  }
  const axis = [state.focus, add(state.focus, times(state.scene.up, 0.15 * state.scene.distance))].map((point) => project(inCamera(eye, point)));
  context.moveTo(...axis[0]);
  context.lineTo(...axis[1]);
  context.strokeStyle = style.getPropertyValue('--faint');
  context.lineWidth = ratio;
  context.stroke();
  context.fillStyle = style.getPropertyValue('--faint');
  context.fillText('subject', axis[1][0] + 5 * ratio, axis[1][1]);

  drawSources(context, eye, project, ratio, state.weights.length > 0 ? state.weights : state.scene.sources.map(() => 0), true);
  const accent = style.getPropertyValue('--accent');
  const own = frustum({ pose: state.pose, lens: state.scene.lens }, 1.5 * state.scene.frustum);
  drawFrustum(context, eye, project, own, accent, 2.5 * ratio, NEAR * state.scene.distance);
  const line = [state.pose.centre, state.focus].map((point) => inCamera(eye, point));
  if (line.every((point) => point[2] > 0)) {
    context.setLineDash([4 * ratio, 4 * ratio]);
    context.lineWidth = ratio;
    context.beginPath();
    context.moveTo(...project(line[0]));
    context.lineTo(...project(line[1]));
    context.stroke();
    context.setLineDash([]);
  }
}
