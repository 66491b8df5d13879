// What the screen of models says.
export default {
  'home.models': 'What this robot knows',
  'home.none': 'Nothing is saved yet. What you teach is saved here automatically.',
  'home.current': 'in use',
  'home.more': 'More about {name}',
  'home.name': 'Name',
  'home.place': 'Place',
  'home.keep': 'Save',
  'home.load': 'Use this one',
  'home.copy': 'Copy',
  'home.begin': 'Start over',
  'home.upload': 'Upload',
  'home.begun': 'A fresh start: {name} knows nothing yet.',
  'home.deleted': '{name} deleted.',
  'home.uploaded': '{name} has been uploaded.',
  'home.damaged': 'This file is damaged.',
  'home.lessons': '{n} pictures learned',
};
