import { readdirSync, readFileSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { brotliCompressSync, constants, gzipSync } from 'node:zlib';
import { svelte } from '@sveltejs/vite-plugin-svelte';
import type { Plugin } from 'vite';
import { defineConfig } from 'vitest/config';

const DIST = '../dist';
const TEXT = /\.(css|html|js|json|svg)$/;
const WORKER = 'service-worker';
/** What is smaller travels in one packet anyway. */
const LEAST_BYTES = 1000;

/** Writes every text file once more with Brotli and once with gzip, for the station to serve. */
function compressed(): Plugin {
  return {
    name: 'compressed',
    apply: 'build',
    closeBundle() {
      const names = readdirSync(DIST, { recursive: true, encoding: 'utf8' });
      for (const name of names.filter((each) => TEXT.test(each))) {
        const path = join(DIST, name);
        const text = readFileSync(path);
        if (text.length < LEAST_BYTES) continue;
        const params = { [constants.BROTLI_PARAM_SIZE_HINT]: text.length };
        writeFileSync(`${path}.br`, brotliCompressSync(text, { params }));
        writeFileSync(`${path}.gz`, gzipSync(text, { level: 9 }));
      }
    },
  };
}

export default defineConfig({
  plugins: [svelte(), compressed()],
  build: {
    outDir: DIST,
    emptyOutDir: true,
    assetsInlineLimit: 0, // the content security policy allows no data: address
    target: 'es2022',
    rolldownOptions: {
      input: {
        index: 'index.html',
        help: 'help.html',
        offline: 'offline.html',
        [WORKER]: 'src/offline/service_worker.ts',
      },
      output: {
        // A service worker has one address for ever, and rules only what lies below it.
        entryFileNames: ({ name }) => (name === WORKER ? '[name].js' : 'assets/[name]-[hash].js'),
      },
    },
    chunkSizeWarningLimit: 400,
  },
  server: {
    proxy: {
      // What is the station's is asked of a running one: `grace demo --dev`, or one on its usual port.
      '^/(api|view|docs|redoc|help|openapi\\.json|sign-in|ack)([/?]|$)': {
        target: process.env.GRACE_STATION ?? 'http://127.0.0.1:8000',
        ws: true,
      },
    },
  },
  test: { include: ['src/**/*.test.ts'] },
});
