import { svelte } from '@sveltejs/vite-plugin-svelte';
import { defineConfig } from 'vitest/config';

export default defineConfig({
  plugins: [svelte()],
  build: {
    outDir: '../dist',
    emptyOutDir: true,
    assetsInlineLimit: 0, // the content security policy allows no data: address
    target: 'es2022',
    chunkSizeWarningLimit: 400,
  },
  server: {
    proxy: {
      // What is the station's is asked of a running one: `grace demo --dev`, or one on its usual port.
      '^/(api|view|docs|redoc|openapi\\.json|sign-in)([/?]|$)': {
        target: process.env.GRACE_STATION ?? 'http://127.0.0.1:8000',
        ws: true,
      },
    },
  },
  test: { include: ['src/**/*.test.ts'] },
});
