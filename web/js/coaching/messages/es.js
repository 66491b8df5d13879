export default {
  'screen.gallery': '¿Qué he aprendido?',
  'screen.why': '¿Por qué?',
  'screen.teaching': '¿Enseño bien?',
  'screen.undo': 'Deshacer lo enseñado',
};
