// The line about what the program does.

import { changed, isWaiting } from './requests.js';
import { showSchemes } from './schemes.js';
import { element, state } from './state.js';
import { isFilming, tellFrames } from './video.js';

// While something is waited for, what the program does.
export async function watch() {
  const isChoosing = state.scene !== null && state.scene.chooses && state.first === null;
  if (isWaiting() || isChoosing || isFilming()) {
    try {
      const status = await (await fetch('status')).json();
      tellWork(status);
    } catch { /* told by the request for the picture */ }
  }
  setTimeout(watch, 400);
}

function tellWork({ stage, done, pieces, warnings, chosen, video }) {
  tellFrames(video);
  if (chosen !== null && state.scene !== null && state.first === null) tellChoice(chosen);
  const text = stage === '' ? '' : `${stage}${pieces > 0 ? `: ${Math.min(done, pieces)} of ${pieces}` : ''} …`;
  if (state.shown === null) element('waiting').textContent = text || 'Reading the scene';
  else if (!state.shown.full && text !== '') element('status').textContent = `coarse; ${text}`;
  else if (state.scene.chooses && state.first === null) element('choosing').textContent = text;
  element('warnings').replaceChildren(...warnings.map((warning) => {
    const item = document.createElement('li');
    item.textContent = warning;
    return item;
  }));
}

// The scheme that `render` takes, once it is known. It is shown unless the person has chosen another meanwhile.
function tellChoice(chosen) {
  state.first = chosen;
  element('choosing').textContent = `${chosen} is what render chooses for this scene`;
  if (state.scheme === state.scene.scheme && !state.isSchemeGiven) showSchemes(chosen);
  // Other pictures are made under it, of the same scheme too.
  if (state.scheme === chosen) changed();
}
