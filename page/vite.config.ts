import { defineConfig } from "vitest/config";

// One script and one style sheet under fixed names: the wheel holds them, and a file that is sent
// to somebody holds them inline.
export default defineConfig({
  base: "./",
  build: {
    outDir: "../src/fleet2d/viewing/page",
    emptyOutDir: true,
    target: "es2022",
    modulePreload: false,
    cssCodeSplit: false,
    rollupOptions: {
      output: {
        entryFileNames: "page.js",
        assetFileNames: "page[extname]",
        codeSplitting: false,
      },
    },
  },
  test: { include: ["test/**/*.test.ts"], environment: "node" },
});
