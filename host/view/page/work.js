// The line about what the program does.

import { isWaiting } from './requests.js';
import { element, state } from './state.js';

// While something is waited for, what the program does.
export async function watch() {
  if (isWaiting()) {
    try {
      const status = await (await fetch('status')).json();
      tellWork(status);
    } catch { /* told by the request for the picture */ }
  }
  setTimeout(watch, 400);
}

function tellWork({ stage, done, pieces, warnings }) {
  const text = stage === '' ? '' : `${stage}${pieces > 0 ? `: ${Math.min(done, pieces)} of ${pieces}` : ''} …`;
  if (state.shown === null) element('waiting').textContent = text || 'Reading the scene';
  else if (!state.shown.full && text !== '') element('status').textContent = `coarse; ${text}`;
  element('warnings').replaceChildren(...warnings.map((warning) => {
    const item = document.createElement('li');
    item.textContent = warning;
    return item;
  }));
}
