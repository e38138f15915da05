// Notes beside the bundle which sources it was built from, so that a test can tell that it is theirs.
import { createHash } from "node:crypto";
import { readdirSync, readFileSync, writeFileSync } from "node:fs";
import { join } from "node:path";

const kept = ["index.html", "package.json", "package-lock.json", "tsconfig.json", "vite.config.ts"];
const sources = readdirSync("src", { recursive: true, withFileTypes: true })
  .filter((entry) => entry.isFile())
  .map((entry) => join(entry.parentPath, entry.name).replaceAll("\\", "/"));
const hash = createHash("sha256");
for (const name of [...kept, ...sources].sort()) {
  hash.update(`${name}\n`);
  hash.update(readFileSync(name));
}
writeFileSync("../src/fleet2d/viewer/page/sources.sha256", `${hash.digest("hex")}\n`);
