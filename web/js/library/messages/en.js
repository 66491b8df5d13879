// The menu's name for the screen of models.
export default {
  'screen.home': 'Models and recordings',
};
