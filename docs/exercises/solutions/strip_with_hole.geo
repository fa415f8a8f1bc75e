// A quarter of a long strip with a hole: radius 1 m, half width 4 m, half length 12 m, thickness 0.5 m.
// gmsh -3 -order 2 strip_with_hole.geo -o strip_with_hole.msh
fine = 0.15;
coarse = 1.6;

Point(1) = {0, 0, 0};
Point(2) = {1, 0, 0, fine};
Point(3) = {12, 0, 0, coarse};
Point(4) = {12, 4, 0, coarse};
Point(5) = {0, 4, 0, coarse};
Point(6) = {0, 1, 0, fine};
Line(1) = {2, 3};
Line(2) = {3, 4};
Line(3) = {4, 5};
Line(4) = {5, 6};
Circle(5) = {6, 1, 2};
Curve Loop(1) = {1, 2, 3, 4, 5};
Plane Surface(1) = {1};
e[] = Extrude {0, 0, 0.5} { Surface{1}; Layers{1}; };

Physical Volume("strip") = {e[1]};
Physical Surface("bottom") = {e[2]};
Physical Surface("right") = {e[3]};
Physical Surface("top") = {e[4]};
Physical Surface("left") = {e[5]};
Physical Surface("hole") = {e[6]};
