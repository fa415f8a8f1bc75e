// A bracket of two legs, 60 mm wide and 10 mm thick, with a fillet between them and a hole in each.
SetFactory("OpenCASCADE");
Box(1) = {0, 0, 0, 0.1, 0.06, 0.01};
Box(2) = {0, 0, 0, 0.01, 0.06, 0.08};
Box(3) = {0.01, 0, 0.01, 0.008, 0.06, 0.008};
Cylinder(4) = {0.018, -0.01, 0.018, 0, 0.08, 0, 0.008};
Cylinder(5) = {0.07, 0.03, -0.01, 0, 0, 0.03, 0.006};
Cylinder(6) = {-0.01, 0.03, 0.055, 0.03, 0, 0, 0.006};
BooleanDifference(7) = { Volume{3}; Delete; }{ Volume{4}; Delete; };
BooleanUnion(8) = { Volume{1}; Delete; }{ Volume{2, 7}; Delete; };
BooleanDifference(9) = { Volume{8}; Delete; }{ Volume{5, 6}; Delete; };
e = 1e-6;
Physical Volume("body") = {9};
Physical Surface("wall hole") = Surface In BoundingBox {-e, 0.024 - e, 0.049 - e, 0.01 + e, 0.036 + e, 0.061 + e};
Physical Surface("load hole") = Surface In BoundingBox {0.064 - e, 0.024 - e, -e, 0.076 + e, 0.036 + e, 0.01 + e};
