// The sentences of the corrections.
export default {
  'settings.picture': 'Imagen',
  'settings.turn': 'Girar la imagen',
  'settings.mirrored': 'La imagen está en espejo',
  'settings.turn_hint': 'Lo aprendido con la imagen anterior ya no sirve.',
  'settings.body': 'Cuerpo',
  'settings.body_hint': 'Lo que significan las direcciones no cambia.',
  'settings.trim': 'Se va a un lado: corrígelo',
  'settings.swapped': 'Izquierda y derecha están cambiadas',
  'settings.reverse': 'Motores que giran al revés',
};
