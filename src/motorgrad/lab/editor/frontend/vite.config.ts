import react from "@vitejs/plugin-react";
import { defineConfig } from "vite";
import { licences } from "./licences.ts";

// Two builds of the same component: a page for the server, and one module for notebooks.
export default defineConfig(({ mode }) => ({
  base: "./",
  plugins: [react(), licences()],
  define: mode === "widget" ? { "process.env.NODE_ENV": '"production"' } : {},
  build: {
    outDir: "../static",
    emptyOutDir: mode !== "widget",
    chunkSizeWarningLimit: 2000,
    assetsInlineLimit: 100_000,
    ...(mode === "widget" && {
      lib: { entry: "src/widget.tsx", formats: ["es" as const], fileName: () => "widget.js", cssFileName: "widget" },
    }),
  },
}));
