// Requests for pictures and weights: what is asked, newest first.

import { release, unpacked } from './answers.js';
import { saveWantedPicture, tellCommand } from './elsewhere.js';
import { tellPath } from './keyframes.js';
import { drawMapSoon } from './map.js';
import { drawPicture, tellStatus } from './picture.js';
import { matrixOf } from './poses.js';
import { tellWeights } from './sources.js';
import { element, state, tab } from './state.js';

const REST = 200;            // milliseconds without a change after which the hand rests

async function post(path, body) {
  const response = await fetch(path, {
    method: 'POST', headers: { 'Content-Type': 'application/json' }, body: JSON.stringify(body),
  });
  if (response.status === 204) return null;
  if (!response.ok) throw new Error(await response.text());
  return response;
}

export function told(error) {
  const problem = element('problem');
  problem.hidden = error === null;
  if (error === null) return;
  const isGone = error instanceof TypeError;
  problem.textContent = isGone ? 'The program does not answer: was it ended?' : error.message;
}

let asked = 0;               // numbers of requests
let drawn = 0;               // the newest request that was drawn
let isCoarseOut = false;     // a coarse picture is on its way
let isCoarseWanted = false;
let fullOut = 0;             // requests for full pictures that wait
let restTimer = 0;

// `arrived` is called once the program has answered: it can do the next picture while this one is drawn.
async function askPicture(moving, arrived) {
  asked += 1;
  const number = asked;
  const at = state.pose;
  const { scheme } = state;
  const body = { tab, pose: matrixOf(at), scheme, layer: state.layer, moving };
  if (moving) body.side = state.scene.moving_side;
  try {
    const response = await post('picture', body);
    if (response === null) return;
    const bytes = await response.arrayBuffer();
    arrived();
    const answer = await unpacked(bytes);
    told(null);
    if (number < drawn) {
      release(answer);
      return;
    }
    drawn = number;
    release(state.shown);
    state.shown = { pose: at, number, scheme, ...answer };
    tellWeights(answer.weights, number);
    drawPicture();
    tellStatus(answer);
    saveWantedPicture();
  } catch (error) {
    told(error);
  }
}

async function pumpCoarse() {
  if (isCoarseOut || !isCoarseWanted) return;
  isCoarseOut = true;
  isCoarseWanted = false;
  const next = () => { isCoarseOut = false; pumpCoarse(); };
  let hasArrived = false;
  await askPicture(true, () => { hasArrived = true; next(); });
  if (!hasArrived) next();
}

async function askFull() {
  if (isCoarseOut || isCoarseWanted) {
    restTimer = setTimeout(askFull, 50);
    return;
  }
  fullOut += 1;
  await askPicture(false, () => {});
  fullOut -= 1;
}

// Whether a picture is waited for.
export const isWaiting = () => state.shown === null || fullOut > 0;

let isWeightsOut = false;
let areWeightsWanted = false;

// Weights take no rendering, so that they follow the hand also where pictures are slow.
async function pumpWeights() {
  if (isWeightsOut || !areWeightsWanted) return;
  isWeightsOut = true;
  areWeightsWanted = false;
  asked += 1;
  const number = asked;
  try {
    const response = await post('weights', { tab, pose: matrixOf(state.pose), scheme: state.scheme });
    tellWeights(await response.json(), number);
  } catch (error) {
    told(error);
  }
  isWeightsOut = false;
  pumpWeights();
}

// The view or what it is made of has changed.
export function changed() {
  isCoarseWanted = true;
  areWeightsWanted = true;
  pumpCoarse();
  pumpWeights();
  clearTimeout(restTimer);
  restTimer = setTimeout(askFull, REST);
  tellCommand();
  tellPath();
  drawMapSoon();
}
