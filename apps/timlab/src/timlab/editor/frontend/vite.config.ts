import react from "@vitejs/plugin-react";
import { defineConfig } from "vite";
import { licences } from "./licences.ts";

// Three builds of the same component: a page for the server, one module for notebooks, and one for pages without a server.
export default defineConfig(({ mode }) => ({
  base: "./",
  plugins: [react(), licences()],
  define: mode !== "production" ? { "process.env.NODE_ENV": '"production"' } : {},
  build: {
    outDir: "../static",
    emptyOutDir: mode === "production",
    chunkSizeWarningLimit: 2000,
    assetsInlineLimit: 100_000,
    ...(mode !== "production" && {
      lib: { entry: `src/${mode}.tsx`, formats: ["es" as const], fileName: () => `${mode}.js`, cssFileName: mode },
    }),
  },
}));
