// The hand: pointers, wheel, keys.

import { stop } from './keyframes.js';
import { drawMapSoon } from './map.js';
import { turnedPose } from './poses.js';
import { changed } from './requests.js';
import { state } from './state.js';
import { add, clamp, cross, dot, length, sub, times, unit } from './vectors.js';

const TURN = Math.PI * 0.75; // radians for the width of the picture
const STEP = Math.PI / 60;   // radians for a key
const TOP = 0.05;            // radians that are kept from the pole

// Takes the view to a pose, and to what it turns around from there.
export function goTo(own, focus = state.focus) {
  state.pose = own;
  state.focus = focus;
  changed();
}

function orbit(around, above) {
  const turnedAround = turnedPose(state.pose, state.focus, state.scene.up, around);
  const offset = sub(turnedAround.centre, state.focus);
  const height = Math.acos(clamp(dot(unit(offset), state.scene.up), -1, 1));
  // Not over the pole.
  const angle = clamp(height - above, TOP, Math.PI - TOP) - height;
  const axis = unit(cross(state.scene.up, offset));
  state.pose = length(cross(state.scene.up, offset)) > 1e-6 ? turnedPose(turnedAround, state.focus, axis, angle) : turnedAround;
  changed();
}

function move(factor) {
  const offset = sub(state.pose.centre, state.focus);
  const distance = clamp(length(offset) * factor, 0.05 * state.scene.distance, 20 * state.scene.distance);
  state.pose = { ...state.pose, centre: add(state.focus, times(unit(offset), distance)) };
  changed();
}

// Sideways, in shares of the picture's width.
function pan(across, below) {
  const distance = length(sub(state.pose.centre, state.focus));
  const width = distance * state.scene.lens.size[0] / state.scene.lens.focal[0];
  const offset = add(times(state.pose.right, -across * width), times(state.pose.down, -below * width));
  state.pose = { ...state.pose, centre: add(state.pose.centre, offset) };
  state.focus = add(state.focus, offset);
  changed();
}

export function back() {
  state.pose = state.scene.start;
  state.focus = state.scene.focus;
  changed();
}

export function listenToPicture(canvas) {
  const hands = new Map();   // pointers that are down
  const middle = () => {
    const all = [...hands.values()];
    const centre = [0, 1].map((i) => all.reduce((sum, own) => sum + own[i], 0) / all.length);
    const spread = all.length > 1 ? Math.hypot(all[0][0] - all[1][0], all[0][1] - all[1][1]) : 0;
    return { centre, spread };
  };
  canvas.addEventListener('pointerdown', (event) => {
    if (state.scene === null) return;
    stop();
    canvas.focus({ preventScroll: true });
    canvas.setPointerCapture(event.pointerId);
    hands.set(event.pointerId, [event.clientX, event.clientY]);
    canvas.classList.add('held');
    event.preventDefault();
  });
  canvas.addEventListener('pointermove', (event) => {
    if (!hands.has(event.pointerId)) return;
    const before = middle();
    hands.set(event.pointerId, [event.clientX, event.clientY]);
    const after = middle();
    const [across, below] = [0, 1].map((i) => (after.centre[i] - before.centre[i]) / canvas.clientWidth);
    if (hands.size > 1) {
      if (before.spread > 0 && after.spread > 0) move(before.spread / after.spread);
      pan(across, below);
    } else if (event.shiftKey || event.buttons === 4) {
      pan(across, below);
    } else {
      orbit(-across * TURN, below * TURN);
    }
  });
  for (const name of ['pointerup', 'pointercancel']) {
    canvas.addEventListener(name, (event) => {
      hands.delete(event.pointerId);
      if (hands.size === 0) canvas.classList.remove('held');
    });
  }
  canvas.addEventListener('wheel', (event) => {
    if (state.scene === null) return;
    event.preventDefault();
    stop();
    const lines = event.deltaMode === 1 ? 16 * event.deltaY : event.deltaY;
    move(Math.exp(clamp(lines, -200, 200) / 600));
  }, { passive: false });
}

export function listenToMap(canvas) {
  let at = null;
  canvas.addEventListener('pointerdown', (event) => {
    canvas.setPointerCapture(event.pointerId);
    at = [event.clientX, event.clientY];
  });
  canvas.addEventListener('pointermove', (event) => {
    if (at === null || state.scene === null) return;
    const [across, below] = [event.clientX - at[0], event.clientY - at[1]].map((x) => x / canvas.clientWidth * Math.PI);
    at = [event.clientX, event.clientY];
    const around = turnedPose(state.observer.pose, state.observer.target, state.scene.up, -across);
    const above = turnedPose(around, state.observer.target, around.right, -below);
    state.observer.pose = Math.abs(dot(above.forward, state.scene.up)) < 0.98 ? above : around;
    drawMapSoon();
  });
  for (const name of ['pointerup', 'pointercancel']) canvas.addEventListener(name, () => { at = null; });
}

export function listenToKeys() {
  const actions = {
    ArrowLeft: () => orbit(-STEP, 0),
    ArrowRight: () => orbit(STEP, 0),
    ArrowUp: () => orbit(0, STEP),
    ArrowDown: () => orbit(0, -STEP),
    '+': () => move(0.95),
    '=': () => move(0.95),
    '-': () => move(1 / 0.95),
    0: back,
  };
  document.addEventListener('keydown', (event) => {
    const isTyping = event.target instanceof Element && event.target.matches('input, select, textarea');
    const action = actions[event.key];
    if (state.scene === null || isTyping || !action || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    stop();
    action();
  });
}
