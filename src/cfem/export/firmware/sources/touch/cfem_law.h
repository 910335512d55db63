/* The law of contact, Signorini's with Coulomb's friction, for points in their frames n, t1, t2:
 *
 *     gap = W lambda + free      gap_n >= 0, lambda_n >= 0, gap_n lambda_n = 0
 *                                |lambda_t| <= mu lambda_n, and lambda_t = -mu lambda_n slip / |slip| where slip = gap_t is not 0 */
#ifndef CFEM_LAW_H
#define CFEM_LAW_H

#ifdef __cplusplus
extern "C" {
#endif

/* Numbers of the room that cfem_law needs for m points. */
#define CFEM_LAW_ROOM(m) (18 * (m) * (m) + 48 * (m) + 8)

/* lambda (3 m,) N: forces to begin with, and the answer. W (3 m, 3 m) mm/N, free (3 m,) mm. 0, or 1 where no forces were found that
 * obey the law; lambda is not changed then. Newton's method from lambda and from no forces, then along the curve of forces over
 * friction; systems: linear ones that may be solved, less those that were: all loops are bounded. */
int cfem_law(int m, const double *W, const double *free, double mu, double *lambda, double *room, int *systems);

/* mm: by how much a point's force, and its gap there, miss the law, both in its frame; `yields` mm/N turns what the force misses into
 * a length. */
double cfem_law_violation(double mu, const double force[3], const double gap[3], double yields);

#ifdef __cplusplus
}
#endif
#endif
