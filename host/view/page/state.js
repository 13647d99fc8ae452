// What the page shows, and where from.

export const element = (id) => document.getElementById(id);

// Its name for the program: every tab has a view of its own.
export const tab = Array.from(crypto.getRandomValues(new Uint32Array(3)), (x) => x.toString(36)).join('');

export const state = {
  scene: null,      // what the program says of it
  pose: null,       // the novel view's camera
  focus: null,      // what it turns around
  weights: [],      // of the sources, for `pose` or a pose shortly before
  scheme: '',
  isSchemeGiven: false, // by the person, in the menu
  first: null,      // the scheme that the command line began with, or that was chosen for the scene; null while it is not known
  layer: 'none',
  shown: null,      // { pose, bitmap, size, layer } of the picture on the screen
  observer: null,   // the camera of the map
  keyframes: [],    // { pose, focus } of a camera path
};
