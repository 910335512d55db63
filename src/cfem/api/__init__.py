"""What `import cfem` offers: functions that call what the commands call. `cfem/__init__.py` has the list.

Lengths are mm, forces N, pressures MPa, volumes mm^3, rotations rad. A cable's displacement is its shortening, its
force is its tension; a chamber's are its growth and its pressure. All are positive in these directions."""
