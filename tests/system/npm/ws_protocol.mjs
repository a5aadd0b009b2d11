// What an app does with @foxglove/ws-protocol: `node --input-type=module - ADDRESS SUBPROTOCOL CASE`; says JSON.
import protocol from "@foxglove/ws-protocol";
import { WebSocket } from "ws";

const [address, subprotocol, name] = process.argv.slice(2);
const say = (value) => console.log(JSON.stringify(value));
const text = new TextDecoder();
const bytes = (value) => new TextEncoder().encode(JSON.stringify(value));
const point = { header: { frame_id: "map" }, point: { x: 2.0, y: 1.0, z: 0.0 } };

/** A client, and the values of its events as they come; `next` takes the first that is wanted. */
class App {
  constructor() {
    this.client = new protocol.FoxgloveClient({ ws: new WebSocket(address, [subprotocol]) });
    this.errors = [];
    this.client.on("error", (error) => this.errors.push(error.message));
    this.info = this.next("serverInfo");
    this.channels = new Map();
    this.client.on("advertise", (channels) => channels.forEach((one) => this.channels.set(one.topic, one)));
    this.services = this.next("advertiseServices");
  }

  next(event, wanted = () => true) {
    return new Promise((resolve) => {
      const take = (value) => wanted(value) && (this.client.off(event, take), resolve(value));
      this.client.on(event, take);
    });
  }

  async channel(topic) {
    while (!this.channels.has(topic)) await this.next("advertise");
    return this.channels.get(topic);
  }

  /** Resolves with the first message of a topic that is wanted. */
  async message(topic, wanted = () => true) {
    const id = this.client.subscribe((await this.channel(topic)).id);
    const { data, timestamp } = await this.next(
      "message",
      (one) => one.subscriptionId === id && wanted(one.data),
    );
    this.client.unsubscribe(id);
    return { data, timestamp };
  }

  json(topic, wanted) {
    return this.message(topic, (data) => wanted(JSON.parse(text.decode(data))));
  }

  publish(topic, message) {
    const id = this.client.advertise({ topic, encoding: "json", schemaName: "geometry_msgs/PointStamped" });
    this.client.sendMessage(id, bytes(message));
  }

  async call(name) {
    const service = (await this.services).find((one) => one.name === name);
    const answer = this.next("serviceCallResponse");
    this.client.sendServiceCallRequest({ serviceId: service.id, callId: 5, encoding: "json", data: bytes({}) });
    return JSON.parse(text.decode((await answer).data));
  }

  async parameters(ask) {
    const answer = this.next("parameterValues", (one) => one.id === "mine");
    ask(this.client);
    return (await answer).parameters;
  }
}

const cases = {
  async watch(app) {
    const shown = {};
    for (const topic of ["/tf", "/map", "/scene"]) {
      const { data, timestamp } = await app.message(topic);
      const seconds = Number(timestamp / 1_000_000_000n);
      const payload = Buffer.from(data.buffer, data.byteOffset, data.byteLength).toString("base64");
      shown[topic] = { channel: await app.channel(topic), payload, seconds };
    }
    const info = await app.info;
    return { name: info.name, capabilities: info.capabilities, topics: [...app.channels.keys()], shown };
  },

  async steer(app) {
    await app.info;
    const moving = app.json("/motion", (motion) => motion.speed > 0.0);
    const ended = app.json("/events", (event) => event.kind === "goal_finished" && event.source === "move_base");
    app.publish("/clicked_point", point);
    await moving;
    return JSON.parse(text.decode((await ended).data)).data.outcome;
  },

  async refused(app) {
    await app.info;
    const status = app.next("status");
    app.publish("/clicked_point", { header: { frame_id: "odom" }, point: point.point });
    return (await status).message;
  },

  async services(app) {
    return [await app.call("/pause"), await app.call("/resume"), await app.call("/cancel")];
  },

  async parameters(app) {
    await app.info;
    const change = [{ name: "planner_patience", value: 7.5 }];
    const changed = await app.parameters((client) => client.setParameters(change, "mine"));
    return [changed, await app.parameters((client) => client.getParameters(["planner_patience"], "mine"))];
  },
};

const app = new App();
say({ value: await cases[name](app), errors: app.errors });
process.exit();
