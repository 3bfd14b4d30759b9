import type { Attachment } from 'svelte/attachments';

type Field = HTMLInputElement | HTMLSelectElement | HTMLTextAreaElement;

/** What is wrong with a field, in the app's words; "" where nothing is. */
export function faultOf({ validity, title, type, minLength, min, max }: FieldFacts): string {
  if (validity.valueMissing) return type === 'file' ? 'Choose a file.' : 'Fill this in.';
  if (validity.tooShort) return `At least ${minLength} characters.`;
  if (validity.patternMismatch) return `${title || 'Not of the form that is needed'}.`;
  if (validity.badInput) return 'A number is needed.';
  if (validity.rangeUnderflow) return `At least ${min}.`;
  if (validity.rangeOverflow) return `At most ${max}.`;
  return validity.valid === false ? 'This cannot be taken as it is.' : '';
}

interface FieldFacts {
  validity: Partial<ValidityState>;
  title: string;
  type: string;
  minLength: number;
  min: string;
  max: string;
}

/** Says what is wrong with a form beside its fields, instead of in the browser's bubbles. */
export const ownMessages: Attachment<HTMLFormElement> = (form) => {
  form.noValidate = true;

  function clear(field: Field): void {
    if (!field.dataset.fault) return;
    document.getElementById(field.dataset.fault)?.remove();
    delete field.dataset.fault;
    field.removeAttribute('aria-invalid');
    field.removeAttribute('aria-describedby');
  }

  function tell(field: Field, text: string): void {
    const message = document.createElement('span');
    message.id = `fault-${crypto.randomUUID()}`;
    message.className = 'field-fault';
    message.textContent = text;
    field.after(message);
    field.dataset.fault = message.id;
    field.setAttribute('aria-invalid', 'true');
    field.setAttribute('aria-describedby', message.id);
  }

  function onsubmit(event: SubmitEvent): void {
    let first: Field | undefined;
    for (const field of form.querySelectorAll<Field>('input, select, textarea')) {
      clear(field);
      const text = faultOf({ minLength: -1, min: '', max: '', ...factsOf(field) });
      if (!text) continue;
      tell(field, text);
      first ??= field;
    }
    if (!first) return;
    event.preventDefault();
    event.stopImmediatePropagation();
    first.focus();
  }

  const oninput = ({ target }: Event) => clear(target as Field);
  form.addEventListener('submit', onsubmit, { capture: true });
  form.addEventListener('input', oninput);
  return () => {
    form.removeEventListener('submit', onsubmit, { capture: true });
    form.removeEventListener('input', oninput);
  };
};

function factsOf(
  field: Field,
): Omit<FieldFacts, 'minLength' | 'min' | 'max'> & Partial<FieldFacts> {
  const { validity, title, type } = field;
  const told = { validity, title, type };
  if (!(field instanceof HTMLInputElement)) return told;
  return { ...told, minLength: field.minLength, min: field.min, max: field.max };
}
