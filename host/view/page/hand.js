// The hand: pointers, wheel, keys.

import { listenToHands, listenToKeys } from './hands.js';
import { stop } from './keyframes.js';
import { drawMapSoon } from './map.js';
import { orbitActions } from './orbits.js';
import { turnedPose } from './poses.js';
import { changed } from './requests.js';
import { state } from './state.js';
import { dot } from './vectors.js';

// Takes the view to a pose, and to what it turns around from there.
export function goTo(own, focus = state.focus) {
  state.pose = own;
  state.focus = focus;
  changed();
}

export function back() {
  goTo(state.scene.start, state.scene.focus);
}

const ACTIONS = {
  isReady: () => state.scene !== null,
  start: stop,
  ...orbitActions(() => [state, state.scene], ({ pose, focus }) => goTo(pose, focus)),
};

export function listenToPicture(canvas) {
  listenToHands(canvas, ACTIONS);
}

export function listenToKeyboard() {
  listenToKeys(ACTIONS, back);
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
