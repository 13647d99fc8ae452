// A video of the path: the program renders its frames while nothing else is asked for.

import { said, saveFile } from './files.js';
import { frames } from './keyframes.js';
import { posesOf } from './path.js';
import { matrixOf } from './poses.js';
import { element, state } from './state.js';

let making = null;           // what ends the request for a video; null while there is none

export const isFilming = () => making !== null;

function tellButton(text) {
  element('save-video').textContent = text;
}

// How many frames are there.
export function tellFrames(video) {
  if (making !== null && video !== null) tellButton(`Cancel (${video[0]} of ${video[1]})`);
}

async function make() {
  const { format, most_frames: most } = state.scene.video;
  const count = frames();
  if (count > most) {
    said(`A video from here has at most ${most} frames: the command line below the path makes longer ones.`);
    return;
  }
  making = new AbortController();
  tellButton('Cancel');
  said('The video is saved as soon as it is there.');
  try {
    const poses = posesOf(state.keyframes, count).map(matrixOf);
    const response = await fetch('video', {
      method: 'POST',
      headers: { 'Content-Type': 'application/json' },
      // None while it is to be chosen for the scene: the program waits for that.
      body: JSON.stringify({ poses, scheme: state.first === null && !state.isSchemeGiven ? null : state.scheme }),
      signal: making.signal,
    });
    if (!response.ok) throw new Error(await response.text());
    const file = await response.blob();
    saveFile(`video.${format}`, file, file.type);
    said(`Saved as video.${format}: ${count} frames.`);
  } catch (error) {
    said(making.signal.aborted ? 'The video is cancelled.' : `There is no video: ${error.message}`);
  }
  making = null;
  tellButton('Save video');
}

export function listenToVideo() {
  element('save-video').addEventListener('click', () => { if (making === null) make(); else making.abort(); });
}
