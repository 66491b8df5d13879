// How the menu calls the screen of models.
export default {
  'screen.home': 'Modelos y grabaciones',
};
