// What extensions add to the page. Each registers its part in a module `extension.js` of its own folder;
// web/js/extensions.js names these modules.

/**
 * @typedef {object} PartScreen
 * @property {() => Promise<unknown>} load  defines the element `NAME-screen`
 * @property {(state: import('./store.js').PageState) => boolean} isOffered  whether the menu shows it
 * @property {{title: string, hint: string}} [settings]  keys of the texts that lead to it from the settings
 *
 * @typedef {object} Part
 * @property {Record<string, PartScreen>} [screens]  by name: what follows # in the address
 * @property {import('./i18n.js').Load} [words]  its sentences
 * @property {(page: import('./page.js').Page) => void} [start]  called before the page connects
 * @property {(page: import('./page.js').Page) => void} [startLater]  called after the first picture
 */

/** @type {Part[]} */
export const parts = [];

/** @param {Part} part */
export const register = (part) => parts.push(part);

/** @returns {Record<string, PartScreen>} */
export const partScreens = () => Object.assign({}, ...parts.map(({ screens }) => screens));
