/** Writes the app's types from the station's OpenAPI document; `python -m webui.build` runs it. */

import { writeFileSync } from 'node:fs';
import openapiTS, { astToString } from 'openapi-typescript';
import ts from 'typescript';

const folder = new URL('src/api/generated/', import.meta.url);

const types = await openapiTS(new URL('openapi.json', folder), {
  defaultNonNullable: false,
  immutable: true,
  inject: "import type { Json } from '../json';",
  rootTypes: true,
  rootTypesNoSchemaPrefix: true,
  // TypeScript cannot follow a property that is made of itself; a named type may be.
  transform: (schema, { path }) =>
    path?.endsWith('/schemas/JsonValue') ? ts.factory.createTypeReferenceNode('Json') : undefined,
});
writeFileSync(new URL('station.d.ts', folder), astToString(types));
