// Keeps the extensions' parts of the page.
// Each extension registers its part in `extension.js` in its folder; web/js/extensions.js lists these modules.

/**
 * @typedef {object} PartScreen
 * @property {() => Promise<unknown>} load  defines the element `NAME-screen`
 * @property {(state: import('./store.js').PageState) => boolean} isOffered  whether the menu shows it
 * @property {{title: string, hint: string}} [settings]  keys of the texts of its link in the settings
 *
 * @typedef {() => Promise<(screen: any) => Promise<HTMLElement | null>>} Section  loads the function that makes a part of a screen
 *
 * @typedef {object} Part
 * @property {Record<string, PartScreen>} [screens]  by name, which follows # in the address
 * @property {Record<string, Section>} [sections]  by the name of the screen that shows it
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

/** Return the address of an extension's screen; null if the extension is not installed. @param {string} name */
export const addressOf = (name) => (name in partScreens() ? `#${name}` : null);

/** Load the extensions' sections of a screen. @param {string} screen */
export const loadSections = (screen) => Promise.all(parts.flatMap(({ sections }) => sections?.[screen]?.() ?? []));

/** Make the sections that extensions add to a screen. @param {string} name @param {import('./components/screen.js').Screen} screen */
export const sectionsOf = async (name, screen) => Promise.all((await loadSections(name)).map((make) => make(screen)));
