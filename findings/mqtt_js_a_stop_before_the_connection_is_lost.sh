#!/usr/bin/env bash
# mqtt 5.16.0 (npm, MQTT.js; aedes 1.2.0): a message that a short program publishes before it ends is not delivered.
#
# Guess before running: connect(), publish("stop") and end(), called one after the other, deliver the stop: publish()
# before the connection queues the message, and end() without force waits for pending messages. If the message cannot
# be delivered, publish() tells its callback.
# Outcome: wrong in both points. end() waits only for messages that were already sent. The queued message is dropped,
# the callback of publish() is never called, there is no event "error", and the callback of end() reports success.
# With a QoS of 1 the stop is not delivered either, and end() had not called back after 20 s. If the program calls
# end() after the event "connect", or in the callback of publish(), the stop arrives.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
echo '{"private": true, "type": "module"}' > package.json
npm install --silent --no-audit --no-fund --ignore-scripts mqtt@5.16.0 aedes@1.2.0
cat > run.js <<'JS'
import assert from "node:assert";
import { once } from "node:events";
import net from "node:net";
import { setTimeout as sleep } from "node:timers/promises";
import { Aedes } from "aedes";
import mqtt from "mqtt";

const broker = await Aedes.createBroker();
const server = net.createServer(broker.handle).listen(0, "127.0.0.1");
await once(server, "listening");
let delivered = 0;
broker.on("publish", (packet, client) => {
  if (client) delivered += String(packet.payload) === "stop";
});

/** Publish a stop and end at one of three moments; return what was delivered and reported. */
async function stop(moment) {
  const told = { published: "nothing", ended: "nothing", errors: 0 };
  delivered = 0;
  const client = mqtt.connect({ host: "127.0.0.1", port: server.address().port });
  client.on("error", () => told.errors++);
  const end = () => client.end((error) => (told.ended = error ? error.message : "success"));
  if (moment === "connected") await once(client, "connect");
  client.publish("robot/drive", "stop", (error) => {
    told.published = error ? error.message : "success";
    if (moment === "published") end();
  });
  if (moment !== "published") end();
  await sleep(3000);
  return { delivered, ...told };
}

for (const moment of ["at once", "connected", "published"]) {
  const found = await stop(moment);
  console.log(`end ${moment}:`, JSON.stringify(found));
  const isLost = moment === "at once";
  const published = isLost ? "nothing" : "success";
  const expected = { delivered: isLost ? 0 : 1, published, ended: "success", errors: 0 };
  assert.deepEqual(found, expected);
}
process.exit(0);
JS
node run.js
