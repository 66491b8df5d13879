// The sentences of the corrections.
export default {
  'settings.picture': 'Imagen',
  'settings.turn': 'Girar la imagen',
  'settings.mirrored': 'La imagen está en espejo',
  'settings.turn_hint': 'Si cambias la imagen, lo que el robot había aprendido ya no sirve.',
  'settings.body': 'Cuerpo',
  'settings.body_hint': 'Estas correcciones no cambian lo que significa una dirección: la izquierda sigue siendo la izquierda.',
  'settings.trim': 'Se va a un lado: corrígelo',
  'settings.swapped': 'Izquierda y derecha están cambiadas',
  'settings.reverse': 'Motores que giran al revés',
};
