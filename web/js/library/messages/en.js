// How the menu calls the screen of models.
export default {
  'screen.home': 'Models and recordings',
};
