/** An error ellipse on a map. */
export interface Ellipse {
  /** Half the longer and the shorter axis, m. */
  longM: number;
  shortM: number;
  /** Direction of the longer axis, rad from north towards east. */
  directionRad: number;
}

/** Chi-squared of two degrees of freedom at 95 %. */
const CHI_SQUARED_95 = 5.991464547107979;

/** Ellipse that holds a position with 95 %; `null` where the numbers are no covariance. */
export function ellipse95(
  covariance: readonly [nn: number, ne: number, ee: number],
): Ellipse | null {
  const [nn, ne, ee] = covariance;
  const middle = (nn + ee) / 2;
  const spread = Math.hypot((nn - ee) / 2, ne);
  const least = middle - spread;
  // A covariance that was rounded on its way may be a hair short of one.
  const isCovariance = Number.isFinite(middle) && middle >= 0 && least >= -1e-6 * (middle + 1);
  if (!isCovariance) return null;
  return {
    longM: Math.sqrt(CHI_SQUARED_95 * (middle + spread)),
    shortM: Math.sqrt(CHI_SQUARED_95 * Math.max(0, least)),
    directionRad: 0.5 * Math.atan2(2 * ne, nn - ee),
  };
}
