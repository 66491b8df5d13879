// What the screen of models says.
export default {
  'home.models': 'Lo que sabe este robot',
  'home.none': 'Todavía no hay nada guardado. Lo que enseñes se guarda aquí automáticamente.',
  'home.current': 'en uso',
  'home.more': 'Más sobre {name}',
  'home.name': 'Nombre',
  'home.place': 'Lugar',
  'home.keep': 'Guardar',
  'home.load': 'Usar este',
  'home.copy': 'Copiar',
  'home.begin': 'Empezar de cero',
  'home.upload': 'Subir',
  'home.begun': 'Todo empieza de nuevo: {name} aún no sabe nada.',
  'home.deleted': '{name} se ha borrado.',
  'home.uploaded': '{name} se ha subido.',
  'home.damaged': 'Este archivo está dañado.',
  'home.lessons': '{n} imágenes aprendidas',
};
