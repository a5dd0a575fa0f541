export { Renderer, Camera, Transform, Geometry, Program, Mesh, Mat4, Vec3, Sphere, Raycast } from "ogl";
