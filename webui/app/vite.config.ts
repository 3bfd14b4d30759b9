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
  test: { include: ['src/**/*.test.ts'] },
});
