// A behavior in a process of its own, for Node: from room to room, ten minutes in each.
//
// robots: {astro: {behaviors: [{type: process, command: rounds.mjs}]}}
import readline from "node:readline";

let rooms = [];
let visits = 0;

readline.createInterface({ input: process.stdin }).on("line", (line) => {
  const message = JSON.parse(line);
  let answer = { type: "ready" };
  if (message.type === "start") {
    rooms = message.rooms.map((room) => room.name);
  } else if (message.type === "decide") {
    const room = rooms[visits % rooms.length];
    visits += 1;
    answer = { type: "plan", plan: [{ go_to: [room, "any"] }, { turn_deg: 360 }, { stay_s: 600 }] };
  }
  process.stdout.write(JSON.stringify(answer) + "\n");
});
