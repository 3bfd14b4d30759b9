import type { Client } from 'openapi-fetch';
import { done, of, told } from './call';
import type { components, paths } from './generated/station';
import type { Alarm, JsonObject } from './types';

type Schemas = components['schemas'];
export type Assignee = Schemas['AssigneeView'];
export type AlarmRuleEntry = Schemas['AlarmRuleView'];
export type AlarmRule = Schemas['AlarmRule'];
export type Watched = Schemas['WatchedView'];

/** Alarms: acknowledged, set aside, noted and assigned, and the rules that raise them. */
export class AlarmApi {
  readonly #http: Client<paths, 'application/json'>;

  constructor(http: Client<paths, 'application/json'>) {
    this.#http = http;
  }

  list = (state: 'open' | 'closed' = 'open') =>
    told(this.#http.GET('/api/alarms', { params: { query: { state } } }));

  /** Names the alarm as it was seen: one that has changed since is not acknowledged unread. */
  acknowledge = ({ id, raised_at, level }: Alarm, note = '') =>
    done(
      this.#http.POST('/api/alarms/{alarm}/ack', {
        params: { path: { alarm: id }, query: { raised_at, level } },
        body: { note },
      }),
    );

  shelve = (alarm: string, minutes: number, note: string) =>
    done(
      this.#http.POST('/api/alarms/{alarm}/shelve', { ...of({ alarm }), body: { minutes, note } }),
    );
  unshelve = (alarm: string) =>
    done(this.#http.POST('/api/alarms/{alarm}/unshelve', of({ alarm })));
  note = (alarm: string, note: string) =>
    done(this.#http.POST('/api/alarms/{alarm}/note', { ...of({ alarm }), body: { note } }));
  /** Have a person look after an alarm, who gets a notice of it; null: nobody any more. */
  assign = (alarm: string, person: string | null, note = '') =>
    done(
      this.#http.POST('/api/alarms/{alarm}/assign', { ...of({ alarm }), body: { person, note } }),
    );
  /** Who may look after an alarm, and when a notice would leave to them. */
  assignees = (alarm: string) =>
    told(this.#http.GET('/api/notices/assignees/{alarm}', of({ alarm })));

  rules = () => told(this.#http.GET('/api/alarm-rules'));
  /** JSON Schema of a rule. */
  schema = () => told(this.#http.GET('/api/alarm-rules/schema')) as Promise<JsonObject>;
  watched = () => told(this.#http.GET('/api/alarm-rules/watched'));
  addRule = (body: AlarmRule) => told(this.#http.POST('/api/alarm-rules', { body }));
  /** Refused with 412 if somebody changed the rule since the version that was seen. */
  changeRule = (rule: string, version: number, body: Schemas['RuleChanges']) =>
    told(this.#http.PATCH('/api/alarm-rules/{rule}', { ...seen(rule, version), body }));
  /** Give a changed rule back as it was delivered, or remove one of the team's own. */
  resetRule = (rule: string, version: number) =>
    done(this.#http.DELETE('/api/alarm-rules/{rule}', seen(rule, version)));
  tryRule = (rule: AlarmRule, days: number) =>
    told(this.#http.POST('/api/alarm-rules/try', { body: { rule, days } }));
  takeOut = (rule: string, robot: string | null, reason: string) =>
    told(
      this.#http.POST('/api/alarm-rules/{rule}/out-of-service', {
        ...of({ rule }),
        body: { robot, reason },
      }),
    );
  putBack = (rule: string, robot: string | null) =>
    told(
      this.#http.DELETE('/api/alarm-rules/{rule}/out-of-service', {
        params: { path: { rule }, query: { robot } },
      }),
    );
}

/** Names the version of a rule that a change was made from. */
function seen(rule: string, version: number) {
  return { params: { path: { rule }, header: { 'if-match': `"${version}"` } } };
}
