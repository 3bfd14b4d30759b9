/** Names by which the app calls what the station's OpenAPI document describes. */

import type {
  ColumnMapping,
  IdentificationResult,
  TrimAdviceView,
  WhatIfSummaryView,
  CommandRequest,
  CommandView,
  PlanView,
  RobotLinkView,
  TargetReportView,
  TransferPartView,
  SamplesView,
  SceneChangeBody,
  ScoresView,
  UploadRequest,
  AlarmView,
  LeaseChange,
} from './generated/station';

export type {
  ComparisonResult as Comparison,
  ComparedRun as ComparisonRun,
  RunSummary as ComparisonSummary,
  Band,
  CostPoint,
  CurrentProposal,
  ImportProposal,
  NewTold,
  ToldView as ToldCurrent,
  IdentificationResult,
  IdentificationView as Identification,
  IdentificationSummaryView as IdentificationListing,
  WhatIfView as WhatIf,
  WhatIfSummaryView as WhatIfListing,
  LearnedView as Learned,
  TrimAdviceView as TrimAdvice,
  AccountBody as GatewayChange,
  AccountView as Account,
  AlarmView as Alarm,
  AlarmsView as Alarms,
  Area,
  NewWater,
  PlaceOutput as WaterPlace,
  SiteInput as SiteDocument,
  WaterChanges,
  WaterView as Water,
  AutoRouteView as Way,
  ChecklistCheckView as ChecklistCheck,
  ChecklistItem,
  ChecklistItemView,
  ChecklistTemplate,
  ChecklistTemplateView,
  ChecklistView as Checklist,
  RobotChecklistsView as RobotChecklists,
  BaseMapView as BaseMap,
  BaseMapsView as BaseMaps,
  BatteryView as Battery,
  RobotBatteryView as RobotBattery,
  PredictionView as Prediction,
  JudgedPredictionsView as JudgedPredictions,
  ContactWindowView as Contact,
  BoxOutput as Box,
  BrokenRow as RowFault,
  ColumnMapping as MappedColumn,
  FaultDocument as FileFault,
  Mapping as RecordingMapping,
  OtherSeriesView as OtherSeries,
  RecordingProposal,
  CalibrationView as Calibration,
  CameraView as Camera,
  FixView as CameraFix,
  BoardsView as Boards,
  RigView as CameraRig,
  LatencyCheckView as LatencyCheck,
  TagBody as CameraTag,
  TagsBody as TagSetBody,
  ServerCameraViewTagsView as TagSet,
  DetectionsView as Detections,
  RestingView as Resting,
  TagTrackView as TagTrack,
  TagView as Tag,
  ServerTagViewTagsView as Tags,
  BudgetView as Budget,
  CatalogueChannelView as CatalogueChannel,
  ChannelChanges,
  ChannelView as Channel,
  MapChoiceView as MapChoice,
  NewChannel,
  ToldChannelView as ToldChannel,
  CommandView as Command,
  ComparedModelView as ComparedModel,
  ComesUpView as ComesUp,
  ConfigurationView as ConfigDocument,
  ControllerBody as ControllerWish,
  DeploymentView as Deployment,
  DiveFactsView as DiveFacts,
  DivesView as Dives,
  RowsView as SeriesRows,
  SeriesView as Series,
  StatisticsView as Statistics,
  DriveView as Drive,
  CurrentStatusView as CurrentStatus,
  CurrentWorthView as CurrentWorth,
  FaultView as Fault,
  EventView as StationEvent,
  FieldMapView as FieldMap,
  FlowArrowView as FlowArrow,
  FlowView as Flow,
  GatewayView as Gateway,
  HealthView as Health,
  IncomingMessageView as IncomingMessage,
  JobView as Job,
  HoldView as Hold,
  LeaseView as Lease,
  KindView as ConfigKind,
  LadderView as PlanLadder,
  LegView as Leg,
  LinkView as Link,
  AttachmentView as LogPicture,
  EntryView as LogEntry,
  HandoverView as Handover,
  LogBookView as LogPart,
  LogItemView as LogItem,
  PageBriefView as SignedPageListing,
  PageView as SignedPage,
  ShiftView as Shift,
  StandView as Standing,
  Weather as WeatherWish,
  LinkTrialView as LinkTrial,
  LiveBatchView as LiveBatch,
  LiveRobotView as LiveRobot,
  MapComparisonView as MapComparison,
  MapEntryView as MapListing,
  MissionView as Mission,
  GrantView as Grant,
  NewLinkView as NewLink,
  NewTokenView as NewToken,
  SigningKeyView as SigningKey,
  SigningView as Signing,
  ObjectiveView as ObjectivePoint,
  OutgoingMessageView as OutgoingMessage,
  ParameterDifference,
  ParameterView as Parameter,
  WaypointBody,
  WaypointsView as WaypointMission,
  ParametersView as ParameterTable,
  PersonView as Person,
  PlanSummaryView as PlanListing,
  PlanView as Plan,
  PolarView as Polar,
  PositionView as Position,
  PrimitiveKind,
  DryRunView as Rehearsal,
  FlightBandView as FlightBand,
  RobotLinkView as RobotLink,
  RobotLogView as LogFile,
  RobotThenView as MomentThen,
  RobotView as Robot,
  Role,
  SatelliteQuoteView as SatelliteQuote,
  SatelliteView as SatelliteLog,
  SceneStateView as SceneView,
  SessionView as Session,
  ShareAboveView as ShareAbove,
  SiteOutput as Site,
  StateView as RobotState,
  SteadyView as SteadyMotion,
  TargetReportView as TargetReport,
  TokenView as Token,
  TimelineView as Timeline,
  TrackView as Track,
  TransferPartView as TransferPart,
  TransferView as Transfer,
  ScheduleRequest as ScheduleWish,
  ScheduledSendView as ScheduledSend,
  UploadRequest as SendWish,
  ViolationView as Violation,
} from './generated/station';

export type { Json, JsonObject } from './json';
/** RFC 3339, UTC. */
export type Time = string;
export type Ned = readonly [north: number, east: number, down: number];
export type NorthEast = readonly [north: number, east: number];
/** Rows of a grid; `null` where the vehicle has no steady glide. */
export type Grid<T = number> = readonly (readonly (T | null)[])[];

export type AlarmLevel = AlarmView['level'];
export type LeaseAct = LeaseChange['act'];
export type CommandKind = CommandRequest['kind'];
export type ColumnRole = ColumnMapping['role'];
export type CommandLevelName = CommandView['level'];
export type LinkKind = RobotLinkView['kind'];
export type PartLevel = TransferPartView['level'];
export type PlanPoint = PlanView['points'][number];
export type FlownPoint = PlanPoint;
export type PlanState = PlanView['state'];
export type RouteChoice = NonNullable<UploadRequest['route']>;
export type TargetPhase = TargetReportView['phase'];

type Place = 'north_m' | 'east_m' | 'depth_m' | 'std_m' | 'fidelity';
type Untold = 'smoothed' | 'received_at' | 'flag';
/** History of one channel; a sample that was drawn from a track may have no place. */
export type Samples = Omit<SamplesView, Place | Untold> &
  Partial<Pick<SamplesView, Untold>> & {
    readonly [P in Place]?: readonly (number | null)[] | null;
  };
type Figure = 'rmse' | 'nlpd' | 'wmse' | 'coverage_90' | 'samples';
/** How good a map is, as far as it is known. */
export type Scores = Pick<ScoresView, 'model' | 'title'> & {
  readonly [F in Figure]: number | null;
};
/** What is changed of the 3D view; what is left out stays. */
export type SceneChange = {
  -readonly [K in keyof SceneChangeBody]:
    NonNullable<SceneChangeBody[K]> | (K extends `slice_${string}` ? null : never);
};

export type IdentifiedParameter = IdentificationResult['parameters'][number];
export type LeftOut = IdentificationResult['left_out'][number];
export type Verdict = IdentifiedParameter['verdict'];
export type RunState = WhatIfSummaryView['state'];
export type TrimOffsets = TrimAdviceView['present'];
export type Values = readonly (number | null)[];
