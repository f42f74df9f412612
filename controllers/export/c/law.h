/* @TITLE@
   Made by fowt_env @VERSION@. SI units and radians. Fixed memory, no allocation, no operating system.

   @STEM@_type law;
   @STEM@_start(&law, reading);          once, with the readings of the first control instant
   @STEM@_step(&law, reading, command);  at every control instant, every @CONTROL_DT@ s, the first included

   The file also has DISCON of the Bladed interface, unless FOWT_WITHOUT_DISCON is defined.
*/
#ifndef @GUARD@_H
#define @GUARD@_H

enum { /* entries of reading */
@FIELDS@
};

typedef struct {
    double memory[@MEMORY@]; /* of the law */
    double force[4]; /* command in force: torque, and pitch of each blade before the drives' limits */
    double pitch[3]; /* last pitch commands, within the drives' limits */
} @STEM@_type;

/* Both return 0, or 1 for a reading that is not finite (nothing is changed). step also returns 2 for a law
   that commands no finite number: the law must then be started again. A command is the generator torque (N m,
   high-speed shaft) and the pitch of the three blades (rad), within limits of value and rate. */
int @STEM@_start(@STEM@_type *law, const double *reading);
int @STEM@_step(@STEM@_type *law, const double *reading, double *command);

#endif
